"""The locks: a hash for every file, and a licence for every package."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tools.licences import licence_of, locked

ROOT = Path(__file__).parents[2]
HASHED = sorted(set(ROOT.glob("requirements*.lock")) - {ROOT / "requirements-torch.lock"})


def entries(lock: Path) -> list[str]:
    """Return a lock's entries, each with its continued lines."""
    lines = [line for line in lock.read_text("utf-8").splitlines() if not line.startswith("#")]
    return "\n".join(lines).replace("\\\n", " ").splitlines()


@pytest.mark.parametrize("lock", HASHED, ids=lambda path: path.name)
def test_every_locked_package_has_a_version_and_hashes(lock: Path) -> None:
    wrong = [
        entry
        for entry in entries(lock)
        if not re.fullmatch(r"[\w.-]+==[\w.]+( ; [^#]+?)?(\s+--hash=sha256:[0-9a-f]{64})+", entry)
    ]
    assert entries(lock)
    assert not wrong


def test_torch_alone_has_no_hash() -> None:
    alone = entries(ROOT / "requirements-torch.lock")
    assert [re.match(r"torch==[\w.]+", entry) is not None for entry in alone] == [True]
    assert not any(entry.startswith("torch==") for lock in HASHED for entry in entries(lock))


def test_the_locked_versions_are_those_that_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    asked = [*project["project"]["dependencies"]]
    asked += [
        one for extra in project["project"]["optional-dependencies"].values() for one in extra
    ]
    asked += [one for group in project["dependency-groups"].values() for one in group]
    versions = locked()
    for text in asked:
        requirement = Requirement(text)
        version = versions.get(canonicalize_name(requirement.name), "none")
        assert requirement.specifier.contains(version), text
    # Its needs are written down for the resolver: a new version may have others.
    (stated,) = project["tool"]["uv"]["dependency-metadata"]
    assert (stated["name"], stated["version"]) == ("torch", versions["torch"])


class Package:
    """An installed package with this metadata and this licence text."""

    def __init__(self, folder: Path, text: str = "", **metadata: str | list[str]) -> None:
        self.metadata = Metadata(Name="made", **metadata)
        (folder / "LICENSE").write_text(text)
        self.files = [folder / "LICENSE"]


class Metadata(dict[str, object]):
    def get_all(self, name: str, default: list[str]) -> object:
        return self.get(name, default)


@pytest.mark.parametrize(
    ("metadata", "text", "licence"),
    [
        ({"License-Expression": "0BSD", "License": "other"}, "", "0BSD"),
        ({"Classifier": ["License :: OSI Approved :: MIT License"]}, "", "MIT License"),
        ({"Classifier": ["License :: OSI Approved"], "License": "ISC"}, "", "ISC"),
        (
            {},
            "Permission is hereby granted, free of\ncharge, to any person obtaining a copy",
            "MIT",
        ),
    ],
)
def test_a_licence_is_what_the_package_states(tmp_path, metadata, text, licence) -> None:
    assert licence_of(Package(tmp_path, text, **metadata)) == licence


def test_a_package_without_a_licence_is_named(tmp_path) -> None:
    with pytest.raises(LookupError, match="made states no licence"):
        licence_of(Package(tmp_path, "Ask me."))

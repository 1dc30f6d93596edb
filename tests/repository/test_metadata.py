"""What is said of the project where it is cited, and what is published of it."""

import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
import yaml
from tools.metadata import placeholders, release_date, written

import nbv

ROOT = Path(__file__).parents[2]
PROJECT = (ROOT / "pyproject.toml").read_text("utf-8")
CHANGELOG = (ROOT / "CHANGELOG.md").read_text("utf-8")


def git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else pytest.skip("no repository, such as an sdist")


def test_every_citation_says_what_the_project_says():
    assert {name: (ROOT / name).read_text("utf-8") for name in written()} == written()


def test_the_version_is_the_newest_of_the_changelog():
    headings = re.findall(r"^## \[(.+?)\]", CHANGELOG, re.MULTILINE)
    assert next(name for name in headings if name != "Unreleased") == nbv.__version__
    with pytest.raises(SystemExit, match="no heading"):
        release_date(CHANGELOG, "99.0")


def test_a_release_has_nothing_that_its_owner_has_not_filled_in():
    tags = git("tag", "--points-at", "HEAD").split()
    if any(re.match(r"v\d", tag) for tag in tags):
        assert not placeholders(PROJECT)


def test_what_the_owner_has_not_filled_in_is_named():
    assert placeholders('doi = "10.1/2"\naffiliation = "OWNER"\n') == ['affiliation = "OWNER"']
    assert placeholders(PROJECT.replace("OWNER", "Ada")) == []


def test_the_joss_paper_has_its_parts_and_cites_what_it_lists():
    text = (ROOT / "joss/paper.md").read_text("utf-8")
    _, front, body = text.split("---\n", 2)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} == set(
        yaml.safe_load(front)
    )
    assert re.findall(r"^# (.+)$", body, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    ]
    assert 750 <= len(body.split()) <= 1750
    references = (ROOT / "joss/paper.bib").read_text("utf-8")
    listed = re.findall(r"^@\w+\{(\w+),", references, re.MULTILINE)
    assert set(re.findall(r"@(\w+)", body)) == set(listed)


def build(kind: str, source: Path, target: Path) -> Path:
    """Build a distribution as `python -m build` does, with the setuptools that is here."""
    target.mkdir()
    code = f"from setuptools import build_meta; print(build_meta.build_{kind}({str(target)!r}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution of the tracked files, unpacked elsewhere."""
    folder = tmp_path_factory.mktemp("release")
    for name in git("ls-files").splitlines():
        copy = folder / "clone" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, copy, follow_symlinks=False)
    with tarfile.open(build("sdist", folder / "clone", folder / "dist")) as archive:
        archive.extractall(folder, filter="data")
    return folder / f"nbv_pose-{nbv.__version__}"


@pytest.mark.slow
def test_the_unpacked_sdist_is_the_repository_without_the_kept_estimates(sdist):
    files = {str(path.relative_to(sdist)) for path in sdist.rglob("*")}
    kept = re.compile(r"docs/reference/confirmation/.*\.npz|\.git-blame-ignore-revs")
    missing = set(git("ls-files").splitlines()) - files
    assert [name for name in missing if not kept.fullmatch(name)] == []
    command = [sys.executable, "-m", "snakemake", "--dry-run", "--config", "experiment=quick"]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(sdist / "src")}
    done = subprocess.run(command, cwd=sdist, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^evaluate +50$", done.stdout, re.MULTILINE)


@pytest.mark.slow
def test_the_wheel_is_the_package_alone_with_a_readme_that_reads_anywhere(sdist):
    with zipfile.ZipFile(build("wheel", sdist, sdist / "dist")) as wheel:
        names = wheel.namelist()
        about = message_from_bytes(wheel.read(next(n for n in names if n.endswith("/METADATA"))))
    folders = {name.split("/")[0] for name in names}
    assert folders == {"nbv", f"nbv_pose-{nbv.__version__}.dist-info"}
    assert "nbv/bundles/shipped/mug.safetensors" in names
    assert about["Description-Content-Type"] == "text/markdown"
    page = str(about.get_payload())
    links = re.findall(r"\]\(([^)\s]+)\)", page)
    assert len(links) == len(re.findall(r"\]\(", (ROOT / "README.md").read_text("utf-8")))
    base = re.compile(rf"https://\S+/nbv/(?:blob|raw)/v{nbv.__version__}/([^#]+)")
    assert [link for link in links if not re.match("https?:|#", link)] == []
    inside = [found[1] for link in links if (found := base.match(link))]
    assert inside
    assert all((ROOT / path).exists() for path in inside)

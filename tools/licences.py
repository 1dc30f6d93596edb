"""Print the licence of every locked package, as the installed package's metadata states it."""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
# The robot's lock holds older versions of some of them, for Python 3.10.
LOCKS = sorted(set(ROOT.glob("requirements*.lock")) - {ROOT / "requirements-robot.lock"})

# What a licence's text begins with or contains, for packages whose metadata name none.
TEXTS = {
    "MIT": "permission is hereby granted, free of charge, to any person obtaining a copy",
    "BSD": "redistribution and use in source and binary forms, with or without",
    "Apache-2.0": "apache license version 2.0",
}

# The table is the same wherever it is made.
WHERE = {
    "sys_platform": "linux",
    "platform_machine": "x86_64",
    "platform_python_implementation": "CPython",
    "python_version": "3.11",
    "python_full_version": "3.11.9",
}

HEAD = """\
What nbv is run, tested, checked, audited and documented with: every package that the locks install
on Linux with Python 3.11. nbv itself is under the MIT licence and contains no code of these
packages.

The registry's build of torch for Linux also brings NVIDIA's CUDA libraries, under NVIDIA's own
licence. A build of torch for processors alone brings none.

| package | version | licence |
|---|---|---|
"""


def locked() -> dict[str, str]:
    """Return the version of each package that the locks install on the system of `WHERE`."""
    text = "\n".join(path.read_text("utf-8") for path in LOCKS)
    entries = re.findall(r"^[\w.-]+==[^\\\n]+", text, re.MULTILINE)
    found = [Requirement(entry) for entry in entries]
    return {
        one.name: str(one.specifier).removeprefix("==")
        for one in found
        if one.marker is None or one.marker.evaluate(WHERE)
    }


def licence_of(package: Distribution) -> str:
    """Return the licence by SPDX expression, else classifier, else one line, else licence text.

    Raises
    ------
    LookupError
        If the package states no licence that is known here.
    """
    metadata = package.metadata
    if expression := metadata.get("License-Expression"):
        return expression
    stated = [
        classifier.rpartition(" :: ")[2]
        for classifier in metadata.get_all("Classifier", [])
        if classifier.startswith("License :: ") and not classifier.endswith("OSI Approved")
    ]
    if stated:
        return "; ".join(stated)
    field = metadata.get("License", "").strip()
    if field and "\n" not in field:
        return field
    files = [path for path in package.files or () if re.match("LICEN[CS]E|COPYING", path.name)]
    texts = [field, *(path.read_text("utf-8") for path in files)]
    for text in texts:
        plain = " ".join(text.lower().split())
        for name, phrase in TEXTS.items():
            if phrase in plain:
                return name
    raise LookupError(f"{metadata['Name']} states no licence: look for it, and add it to TEXTS")


def table() -> str:
    """Return the Markdown table of all locked packages, with its introduction."""
    rows = []
    for name, version in sorted(locked().items()):
        try:
            rows.append(f"| {name} | {version} | {licence_of(distribution(name))} |")
        except PackageNotFoundError:
            raise LookupError(f"{name} is not installed: run this with .venv/bin/python") from None
    return HEAD + "\n".join(rows) + "\n"


if __name__ == "__main__":
    try:
        sys.stdout.write(table())
    except LookupError as error:
        sys.exit(str(error))

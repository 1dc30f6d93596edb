"""Where a result comes from: the source files it depends on, and the versions it was made with."""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import json
import platform
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

PACKAGES = (
    "numpy",
    "scipy",
    "pandas",
    "torch",
    "safetensors",
    "trimesh",
    "embreex",
    "pyrender",
    "matplotlib",
    "hydra-core",
    "snakemake",
)


def source_files(
    script: str | Path, source_root: str | Path, chosen: Iterable[str] = ()
) -> list[str]:
    """Return the modules of nbv that a script imports, directly or not, wherever it does so.

    Found by reading, not by running, and so without the optional modules that a registry names in
    strings: those that a configuration chooses are given in `chosen`.

    Parameters
    ----------
    script : path
        A Python file.
    source_root : path
        The folder that holds the package ``nbv``.
    chosen : iterable of str
        Registry entries such as ``nbv.rendering.embree:EmbreeRenderer``.

    Returns
    -------
    list of str
        Sorted paths below `source_root`.
    """
    root = Path(source_root)
    found = {path for entry in chosen for path in _files_of(entry.partition(":")[0], root)}
    waiting = [Path(script), *found]
    while waiting:
        for module in _imported_modules(waiting.pop()):
            for path in _files_of(module, root):
                if path not in found:
                    found.add(path)
                    waiting.append(path)
    return sorted(str(path) for path in found)


@functools.cache
def _imported_modules(path: Path) -> frozenset[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(name for name in names if name == "nbv" or name.startswith("nbv."))


def _files_of(module: str, root: Path) -> Iterator[Path]:
    """Yield the file of a module and the `__init__` files of the packages it lies in."""
    parts = module.split(".")
    for depth in range(1, len(parts) + 1):
        package = root.joinpath(*parts[:depth])
        for path in (package / "__init__.py", package.with_suffix(".py")):
            if path.is_file():
                yield path


def git_commit(directory: str | Path = Path(__file__).parent) -> str:
    """Return the commit checked out in a folder, this package's own unless another is given.

    It is marked ``-dirty`` where files differ from it, and ``unknown`` outside a checkout.
    """
    try:
        described = subprocess.run(
            ["git", "-C", str(directory), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return described.stdout.strip()


def versions() -> dict[str, object]:
    """Return the versions of Python, the platform and the packages that results depend on."""
    packages = {}
    for name in PACKAGES:
        try:
            packages[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            packages[name] = "not installed"
    return {
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": packages,
    }


def read_provenance(root: Path) -> dict[str, Any]:
    """Read ``provenance.json`` of a run or reference; empty where there is none."""
    path = root / "provenance.json"
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}

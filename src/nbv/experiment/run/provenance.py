"""Where a result comes from: the source files it depends on, and the versions it was made with."""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import importlib.util
import json
import logging
import os
import platform
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

logger = logging.getLogger(__name__)

UNRELATED = {"nbv.experiment.run.jobs"}
"""Modules that change no result: logs, checksums and the messages of jobs that fail."""

_TEMPLATES = Path(__file__).parents[1] / "templates"

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


@functools.cache
def source_files(script: str | Path, chosen: tuple[str, ...] = ()) -> list[str]:
    """Return the modules of nbv that a script imports, directly or not, wherever it does so.

    Files are parsed and not run; imports for type checkers alone do not count. A registry names
    optional modules in strings, which no import shows: `chosen` gives those that a configuration
    chooses, as entries such as ``nbv.data.embree:EmbreeRenderer``. Paths are sorted, with the
    templates that a module fills in: those of its name, in the folder ``templates``, and the CSV
    files of its name beside it. An ``__init__`` file counts where something is imported from it.
    What `UNRELATED` imports does not count.
    """
    imports = _imports()
    dependencies: set[str] = set()
    waiting = [*_imported_names(script), *(entry.partition(":")[0] for entry in chosen)]
    while waiting:
        module = waiting.pop()
        if module in imports and module not in dependencies | UNRELATED:
            dependencies.add(module)
            waiting += imports[module]
    return sorted({file for module in dependencies for file in _files_of(module)})


@functools.cache
def _imports() -> dict[str, set[str]]:
    """Return what each module imports of nbv and of the studies."""
    import grimp

    # What is imported for type checkers alone does not run.
    graph = grimp.build_graph(*_folders(), cache_dir=None, exclude_type_checking_imports=True)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


@functools.cache
def _folders() -> dict[str, Path]:
    """Return the folders of the packages that results depend on; `studies` only in a checkout."""
    specs = {name: importlib.util.find_spec(name) for name in ("nbv", "studies")}
    return {name: Path(str(spec.origin)).parent for name, spec in specs.items() if spec}


def _imported_names(script: str | Path) -> Iterator[str]:
    """Yield the modules that a script imports, and names in them that may be modules."""
    for node in ast.walk(ast.parse(Path(script).read_text(encoding="utf-8"), str(script))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))


def _files_of(module: str) -> Iterator[str]:
    package, *parts = module.split(".")
    path = _folders()[package].joinpath(*parts)
    yield str(path / "__init__.py" if path.is_dir() else path.with_suffix(".py"))
    yield from map(str, _TEMPLATES.glob(f"{path.name}[._]*"))
    yield from map(str, path.parent.glob(f"{path.name}[._]*csv"))


def git_commit(directory: str | Path = Path(__file__).parent) -> str:
    """Return the commit checked out in a folder, by default this package's.

    It is marked ``-dirty`` where files differ from it, and ``unknown`` outside a checkout and, with
    a warning, where git refuses to answer, such as for the checkout of another user.
    """
    try:
        described = subprocess.run(
            ["git", "-C", str(directory), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"LC_ALL": "C"},
        )
    except (OSError, subprocess.CalledProcessError) as error:
        # For another user's checkout, git's reason names the command that allows it.
        reason = " ".join((getattr(error, "stderr", "") or str(error)).split())
        if "not a git repository" not in reason:
            logger.warning("the commit is unknown: %s", reason)
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

"""Imports point down the floors of the house, and torch and GL live in one room each."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "nbv"
FLOORS = [
    {
        *("__init__", "amounts", "angles", "config", "errors", "files", "jobs", "provenance"),
        *("labels", "schema", "seeds", "validation"),
    },
    {"meshes"},
    {"rendering"},
    {"estimation"},
    {"calibration"},
    {"recommendation"},
    {"experiments"},
    {"statistics"},
    {"paper"},
    {"reporting"},
    {"reference"},
]
LIVES_ALONE = {"torch": "estimation", "OpenGL": "rendering", "pyrender": "rendering"}
MODULES = sorted(PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def floor(name: str) -> int:
    return next(level for level, rooms in enumerate(FLOORS) if name in rooms)


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            if node.module == "nbv":
                found |= {f"nbv.{alias.name}" for alias in node.names}
            found.add(node.module)
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path):
    here = floor(room(path))
    for name in imports(path):
        if name.startswith("nbv."):
            there = name.split(".")[1]
            if there != room(path):
                level = floor(there)
                assert level < here or (level == here == 0), f"{path} imports {name}"
        library = name.split(".")[0]
        assert LIVES_ALONE.get(library, room(path)) == room(path), f"{path} imports {name}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_has_at_most_300_lines(path):
    assert len(path.read_text().splitlines()) <= 300

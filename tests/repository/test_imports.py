import re
import subprocess
import sys
import tomllib
from itertools import permutations
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]


def test_the_import_contracts_are_kept():
    # In a process of its own: import-linter turns off the loggers that other tests watch.
    lint = "from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    command = [sys.executable, "-c", f"import sys; {lint}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_drawing_shows_every_import_between_rooms():
    *layers, _ground = CONTRACTS["contracts"][0]["layers"]
    subpackages = [name for layer in layers for name in layer.split(" | ")]
    graph = grimp.build_graph("nbv", cache_dir=None)
    for name in subpackages:
        graph.squash_module(f"nbv.{name}")
    imports = {
        (upper, lower)
        for upper, lower in permutations(subpackages, 2)
        if graph.direct_import_exists(importer=f"nbv.{upper}", imported=f"nbv.{lower}")
    }
    text = (ROOT / "docs" / "architecture.md").read_text()
    arrows = set(re.findall(r"^ +(\w+) --> (\w+)$", text, re.MULTILINE))
    assert arrows == imports

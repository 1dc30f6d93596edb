"""The linter refuses what would run data as code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TREES = ("src/nbv", "workflow/scripts", "tests", "performance")

# Ruff's rule and a line that breaks it.
REFUSED = {
    "S102": 'exec("1")',
    "S301": "import pickle\n\npickle.loads(b'')",
    "S302": "import marshal\n\nmarshal.loads(b'')",
    "S307": 'eval("1")',
    "S506": 'import yaml\n\nyaml.load("1", Loader=yaml.Loader)',
    "S602": 'import subprocess\n\nsubprocess.run("ls " + __name__, shell=True)',
    "S604": 'from nbv import jobs\n\njobs.start("ls", shell=True)',
    "S605": 'import os\n\nos.system("ls " + __name__)',
    "TID251": 'import torch\n\ntorch.load("weights")',
}


def rules_broken(code: str, path: Path) -> set[str]:
    """Return the rules that ruff, set up as in pyproject.toml, finds broken by a file's text."""
    name = f"--stdin-filename={path}"
    done = subprocess.run(
        (sys.executable, "-m", "ruff", "check", "--output-format=concise", "--no-cache", name, "-"),
        input=code,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert not done.stderr
    return set(re.findall(r": ([A-Z]+\d+) ", done.stdout))


@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("rule", REFUSED)
def test_data_that_runs_as_code_is_refused(rule: str, tree: str) -> None:
    assert rule in rules_broken(f"{REFUSED[rule]}\n", ROOT / tree / "example.py")


def test_safe_readers_are_not_refused() -> None:
    code = 'import yaml\n\nyaml.safe_load("1")\n'
    assert not rules_broken(code, ROOT / "tests" / "example.py") & set(REFUSED)


def test_no_rule_is_silenced_and_numpy_reads_no_pickle() -> None:
    """Neither can be a rule of ruff's: an exception to it, and an argument of `numpy.load`."""
    silenced = re.compile(rf"noqa.*\b({'|'.join(REFUSED)})\b|allow_pickle\s*=\s*True")
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for tree in TREES
        for path in sorted((ROOT / tree).rglob("*.py"))
        if path != Path(__file__)
        for match in silenced.finditer(path.read_text("utf-8"))
    ]
    assert not found


def test_the_rules_of_the_workflow_run_no_text_as_code() -> None:
    """Ruff does not read Snakefiles. Every job is a script, so that no shell sees a file's name."""
    text_as_code = re.compile(
        r"\b(?:eval|exec|os\.system|os\.popen)\(|\b(?:pickle|marshal)\b|yaml\.load\(|shell=True"
        r"|^\s+(?:shell|run):",
        re.MULTILINE,
    )
    files = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").rglob("*.smk"))]
    assert len(files) > 10
    assert not {path.name for path in files if text_as_code.search(path.read_text("utf-8"))}

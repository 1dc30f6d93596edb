"""The example of docs/extending.md: its edits are made, and its command is planned."""

import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

from made_estimates import evidence_of
from nbv.core.circle import criteria
from nbv.core.circle.belief import every_belief
from projects import Project

TEXT = (Path(__file__).parents[2] / "docs/extending.md").read_text("utf-8")
EXAMPLE = TEXT.partition("## Add a criterion")[2].partition("\n## ")[0]


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", EXAMPLE, re.MULTILINE | re.DOTALL)


def replace_line(path: Path, text: str, before: str = "") -> None:
    """Put lines of an example in the place of the first of them."""
    first = text.splitlines()[0]
    lines = path.read_text("utf-8").splitlines()
    assert lines.count(first) == 1
    place = lines.index(first)
    path.write_text("\n".join([*lines[:place], before, text.rstrip(), *lines[place + 1 :], ""]))


def add_the_criterion(path: Path) -> None:
    function, entry = blocks("python")
    replace_line(path, entry, before=f"{function}\n")


def test_the_criterion_of_the_example_is_the_expected_entropy_of_the_next_estimate(tmp_path):
    path = tmp_path / "criteria.py"
    shutil.copyfile(criteria.__file__, path)
    add_the_criterion(path)
    evidence = evidence_of()
    given = every_belief(evidence)
    made = runpy.run_path(str(path))["CRITERIA"]["sharpest"](given, evidence, "average")
    likelihood = evidence.conditionals.estimate
    n_bins = evidence.n_bins
    for delta in (0, 1, n_bins - 1):
        expected = np.zeros(n_bins)
        for theta in range(n_bins):
            row = likelihood[(theta + delta) % n_bins]
            spread = -np.sum(row[row > 0] * np.log(row[row > 0]))
            expected += given.probabilities[:, theta] * spread
        np.testing.assert_allclose(made[:, delta], expected, rtol=1e-4)


@pytest.mark.slow
def test_the_example_adds_a_method_to_the_leaderboard_and_trains_nothing(scratch: Project):
    add_the_criterion(scratch.folder / "src/nbv/core/circle/criteria.py")
    (configuration,) = blocks("yaml")
    replace_line(scratch.folder / "config/config.yaml", configuration)

    (command,) = blocks("sh")
    program, *arguments = command.split()
    assert program == "snakemake"
    assert scratch.would_run(targets=tuple(arguments[2:])) == {
        "lookup": 4,
        "evaluate": 4,
        "evaluate_extensions": 4,
        "leaderboard": 1,
    }

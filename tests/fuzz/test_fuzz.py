"""Damaged files of every kind: a right result or one line, and nothing else."""

import subprocess
import sys
from pathlib import Path

import pytest
from tests.fuzz import worker
from tests.fuzz.campaign import Campaign, Case, Worker, cases
from tests.fuzz.readers import READERS, Reader

from nbv.errors import UserError

SEED = 20241


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return Campaign(tmp_path_factory.mktemp("fuzz"), SEED)


@pytest.fixture(scope="module")
def outcomes(campaign):
    """A valid file and five damaged ones of each kind."""
    return list(campaign.run(cases(5 * len(READERS))))


@pytest.mark.parametrize("kind", READERS)
def test_damaged_files_give_a_right_result_or_one_line(outcomes, kind):
    of_kind = [outcome for outcome in outcomes if outcome.case.reader == kind]
    assert [outcome.outcome for outcome in of_kind if outcome.case.number < 0] == ["result"]
    assert len(of_kind) == 6
    assert [outcome for outcome in of_kind if outcome.outcome == "failed"] == []


def test_a_seed_damages_a_file_in_the_same_way(campaign, tmp_path):
    paths = [campaign.write_case(Case("off", 3), tmp_path / name) for name in ("a", "b")]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    other = campaign.write_case(Case("off", 4), tmp_path / "c")
    assert other.read_bytes() != paths[0].read_bytes()


def refuses_in_two_lines(path):
    error = UserError("")
    error.args = ("one\ntwo",)
    raise error


def breaks(path):
    raise KeyError("dataset")


@pytest.mark.parametrize(
    ("read", "problem", "expected"),
    [
        (Path.read_text, lambda text: "", "result"),
        (Path.read_text, lambda text: "an absurd value", "failed"),
        (refuses_in_two_lines, lambda text: "", "failed"),
        (breaks, lambda text: "", "failed"),
    ],
)
def test_what_counts_as_a_failure(tmp_path, monkeypatch, read, problem, expected):
    (tmp_path / "x").write_text("x")
    made = {"x": Reader("x", Path.touch, read, problem)}
    monkeypatch.setattr(worker, "READERS", made)
    assert worker.outcome_of("x", tmp_path / "x")[0] == expected


@pytest.mark.parametrize(
    ("program", "is_forbidden"),
    [
        ("open('inside.txt', 'w')", False),
        ("open('../../outside.txt', 'w')", True),
        ("import os; os.mkdir('../../outside')", True),
        ("import socket; socket.create_connection(('localhost', 9))", True),
    ],
)
def test_writing_elsewhere_and_the_network_are_noticed(tmp_path, program, is_forbidden):
    """By a guard that Python loads in the process that reads, and in those that it starts."""
    (tmp_path / "campaign").mkdir()
    with Worker(tmp_path / "campaign" / "worker") as asked:
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=asked.environment(),
            cwd=asked.folder,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert (done.returncode != 0) == is_forbidden
    assert (b"forbidden while a file is fuzzed" in done.stderr) == is_forbidden
    assert not (tmp_path / "outside.txt").exists()

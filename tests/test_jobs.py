from __future__ import annotations

import errno
import logging
from pathlib import Path
from types import SimpleNamespace

import pytest

from nbv.errors import UserError
from nbv.jobs import job


@pytest.fixture
def snakemake(tmp_path):
    yield SimpleNamespace(
        output=["out.csv"],
        log=[str(tmp_path / "logs" / "train" / "mug.log")],
        rule="train",
        wildcards=["mug", "00"],
    )
    root = logging.getLogger()
    for handler in root.handlers[:]:
        if type(handler) in (logging.FileHandler, logging.StreamHandler):
            root.removeHandler(handler)
            handler.close()


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (UserError("x.obj: no faces"), "error: x.obj: no faces"),
        (
            OSError(errno.ENOSPC, "No space left on device"),
            "error: out.csv: no space left on the disk; free some and run the same command again",
        ),
        (
            OSError(errno.ENOSPC, "No space left on device", "a.npy"),
            "error: a.npy: no space left on the disk; free some and run the same command again",
        ),
    ],
)
def test_a_mistake_is_one_line_everywhere(snakemake, tmp_path, capsys, error, line):
    with pytest.raises(SystemExit) as exit_, job(snakemake):
        raise error
    assert exit_.value.code == 1
    assert (tmp_path / "logs" / "last_error.txt").read_text() == line + "\n"
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert f"train mug/00] {line}" in printed


def test_a_crash_keeps_its_traceback_in_the_log_alone(snakemake, capsys):
    with pytest.raises(SystemExit), job(snakemake):
        raise ZeroDivisionError("oh")
    assert "Traceback" not in capsys.readouterr().err
    assert "Traceback" in Path(snakemake.log[0]).read_text()


def test_progress_goes_to_the_terminal_and_to_the_log(snakemake, capsys):
    with job(snakemake):
        logging.getLogger("nbv.estimation").info("epoch 1")
    assert "train mug/00] epoch 1" in capsys.readouterr().err
    assert "epoch 1" in Path(snakemake.log[0]).read_text()

from __future__ import annotations

import errno
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from nbv.errors import UserError
from nbv.experiment.run.jobs import (
    LAST_ERROR,
    NO_SPACE,
    begin_run,
    import_from,
    job,
    why_stopped,
    write_checksum,
)


@pytest.fixture(autouse=True)
def environment():
    """A run that a test begins leaves nothing in the environment of later tests."""
    before = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def snakemake(tmp_path):
    yield SimpleNamespace(
        input=[],
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
            OSError(errno.EROFS, "Read-only file system", "a.npy"),
            "error: a.npy: cannot be written, the file system is read-only",
        ),
        (
            MemoryError("Unable to allocate 7 TiB"),
            "error: memory ran out (Unable to allocate 7 TiB): use fewer --cores, or smaller "
            "settings",
        ),
        (
            RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: 9 bytes"),
            "error: memory ran out ([enforce fail] DefaultCPUAllocator: can't allocate memory: 9 "
            "bytes): use fewer --cores, or smaller settings",
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


def test_an_error_while_tidying_up_hides_no_full_disk(snakemake, capsys):
    """As with a PDF that matplotlib cannot finish."""

    def write() -> None:
        try:
            raise OSError(errno.ENOSPC, "No space left on device")
        finally:
            raise AttributeError("'Stream' object has no attribute 'pos'")

    with pytest.raises(SystemExit), job(snakemake):
        write()
    assert "error: out.csv: no space left on the disk" in capsys.readouterr().err


def test_a_crash_keeps_its_traceback_in_the_log_alone(snakemake, capsys):
    with pytest.raises(SystemExit), job(snakemake):
        raise ZeroDivisionError("oh")
    assert "Traceback" not in capsys.readouterr().err
    assert "Traceback" in Path(snakemake.log[0]).read_text()


def test_progress_goes_to_the_log_and_once_a_minute_to_the_terminal(snakemake, capsys, monkeypatch):
    clock_s = [1000.0]
    monkeypatch.setattr("nbv.experiment.run.jobs.time.monotonic", lambda: clock_s[0])
    with job(snakemake):
        for epoch in range(1, 10):
            clock_s[0] += 20.0
            logging.getLogger("nbv.experiment.estimation").info("epoch %d", epoch)
        logging.getLogger("nbv.experiment.estimation").warning("no depth")
        logging.getLogger("nbv.experiment.run.reference").info(
            "agrees", extra={"for_terminal": True}
        )
    shown = [line.partition("] ")[2] for line in capsys.readouterr().err.splitlines()]
    assert shown == ["epoch 3", "epoch 6", "epoch 9", "no depth", "agrees"]
    assert Path(snakemake.log[0]).read_text().count("epoch") == 9


def test_inputs_are_held_to_their_checksums_and_outputs_get_theirs(
    snakemake, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    snakemake.input, snakemake.output = ["results/a/in.csv"], ["results/a/out.csv"]
    Path("results/a").mkdir(parents=True)
    Path("results/a/in.csv").write_text("whole")
    write_checksum("results/a/in.csv")
    with job(snakemake):
        Path("results/a/out.csv").write_text("made")
    assert Path("results/a/checksums/out.csv.sha256").is_file()
    Path("results/a/in.csv").write_text("wholf")
    with pytest.raises(SystemExit), job(snakemake):
        raise AssertionError("a damaged input was read")
    assert "results/a/in.csv differs" in Path("logs/last_error.txt").read_text()


@pytest.mark.parametrize("named", ["", "results/a/in.csv: "])
def test_an_error_names_the_files_that_the_job_read(snakemake, tmp_path, monkeypatch, named):
    monkeypatch.chdir(tmp_path)
    snakemake.input, snakemake.output = ["src/code.py", "results/a/in.csv"], []
    Path("results/a").mkdir(parents=True)
    Path("results/a/in.csv").write_text("whole")
    write_checksum("results/a/in.csv")
    with pytest.raises(SystemExit), job(snakemake):
        raise UserError(f"{named}object 'mug-0019' is missing")
    line = Path("logs/last_error.txt").read_text()
    assert line.count("results/a/in.csv") == 1
    assert "code.py" not in line


def test_a_log_that_cannot_be_written_is_named(snakemake, tmp_path, capsys):
    (tmp_path / "logs").write_text("a file where the folder should be")
    with pytest.raises(SystemExit), job(snakemake):
        pass
    assert "mug.log: cannot be written" in capsys.readouterr().err


@pytest.fixture
def ended(snakemake, tmp_path):
    def run(name, error=None):
        snakemake.log[0] = str(tmp_path / "results" / "logs" / f"{name}.log")
        try:
            with job(snakemake):
                if error is not None:
                    raise error
        except (SystemExit, KeyboardInterrupt):
            pass

    return run


KILLED = "error: killed from outside: "


def test_jobs_that_end_without_a_word_were_killed(ended, tmp_path):
    results = str(tmp_path / "results")
    logs = tmp_path / "results/logs"
    begin_run(results)
    ended("whole")
    ended("interrupted", KeyboardInterrupt())
    assert why_stopped(results) == []
    ended("crashed", ZeroDivisionError())
    ended("failed", UserError("x"))
    assert why_stopped(results) == ["error: x"]
    (logs / "train").mkdir()
    (logs / "train/mug.log").write_text("[10:00:00 train mug] epoch 3\n")
    (logs / "train/old.log").write_text("[10:00:00 train old] epoch 3\n")
    before = time.time() - 100
    os.utime(logs / "train/old.log", (before, before))
    failed, killed, advice = why_stopped(results)
    assert (failed, killed) == ("error: x", f"{KILLED}train/mug")
    assert "fewer --cores" in advice


def test_a_full_disk_is_named_where_it_cut_logs_off(ended, tmp_path):
    results = str(tmp_path / "results")
    begin_run(results)
    ended("failed", OSError(errno.ENOSPC, "No space left on device"))
    (tmp_path / "results/logs/cut.log").write_text("[10:00:00 cut] epo")
    assert why_stopped(results) == [f"error: out.csv: {NO_SPACE}"]


def test_a_disk_that_is_nearly_full_is_named_where_no_job_said_more(tmp_path, monkeypatch):
    results = str(tmp_path / "results")
    begin_run(results)
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=10**6))
    assert why_stopped(results) == [f"error: {results}: {NO_SPACE}"]


def test_a_run_begins_with_no_error(tmp_path):
    logs = tmp_path / "results/one/logs"
    logs.mkdir(parents=True)
    (logs / LAST_ERROR).write_text("error: of yesterday\n")
    begin_run(str(logs.parent))
    assert why_stopped(str(logs.parent)) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"file/two cannot be written"):
        begin_run(str(tmp_path / "file/two"))


def test_jobs_import_packages_of_a_folder_before_those_of_others(tmp_path, monkeypatch):
    (tmp_path / "beside.py").write_text("print('found')")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    import_from(tmp_path)
    assert sys.path[0] == str(tmp_path)
    assert os.environ["PYTHONPATH"] == f"{tmp_path}{os.pathsep}/elsewhere"
    done = subprocess.run([sys.executable, "-c", "import beside"], capture_output=True, text=True)
    assert done.stdout == "found\n"

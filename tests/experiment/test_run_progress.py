"""What is shown of a run, from what Snakemake and the jobs say of it."""

from __future__ import annotations

import io
import logging
import re
import time

import numpy as np
import pytest

from nbv.data.depth_images import write_depth
from nbv.experiment.estimation.training import Progress
from nbv.experiment.jobs import ERASE_LINE
from nbv.progress import run
from nbv.progress.chatter import WithoutChatter, tells_the_user
from nbv.progress.estimate import Estimate, Job
from nbv.progress.line import Line, how_far
from nbv.progress.run import Planned, RunProgress, benchmarked_s, said_left_s


def record(event, **what) -> logging.LogRecord:
    return logging.makeLogRecord({"event": event, "created": time.time(), **what})


def lines_of(stream: io.StringIO) -> list[str]:
    return [re.sub(r"\d", "0", line[:14]) + line[14:] for line in stream.getvalue().splitlines()]


def progress_of(planned, in_place=False, stops_at_failure=True):
    stream = io.StringIO()
    return RunProgress(planned, 2, Line(stream, in_place), stops_at_failure), stream


def three_jobs() -> dict[int, Planned]:
    return {
        1: Planned(Job("train", reference_s=60), "train"),
        2: Planned(Job("train", reference_s=60), "train"),
        3: Planned(Job("table", needs=frozenset({1, 2}), reference_s=10), "table"),
    }


def test_a_log_gets_the_last_line_alone_when_a_run_is_short():
    progress, stream = progress_of(three_jobs())
    assert progress.first_estimate() == "3 jobs to do, about 1 min by the reference run's times"
    progress.begin()
    progress.emit(record("job_started", jobs=[1, 2]))
    for number in (1, 2, 3):
        progress.emit(record("job_finished", job_id=number))
    progress.end()
    assert lines_of(stream) == ["[00:00:00 nbv] 100 % done in 0 s, 3 of 3 jobs"]


def test_jobs_that_nobody_timed_are_said_to_be_guessed():
    planned = three_jobs() | {4: Planned(Job("bundle"), "bundle")}
    said = "4 jobs to do, about 2 min by the reference run's times (1 job guessed)"
    assert progress_of(planned)[0].first_estimate() == said
    # As of `make bundles`: two short jobs that were timed, and long ones that were not.
    planned |= {number: Planned(Job("bundle"), "bundle") for number in (5, 6, 7)}
    assert progress_of(planned)[0].first_estimate() == "7 jobs to do"
    unknown = {number: Planned(Job("bundle"), "bundle") for number in (1, 2)}
    assert progress_of(unknown)[0].first_estimate() == "2 jobs to do"


def test_a_log_gets_a_line_at_each_interval_and_a_terminal_one_that_is_written_over(monkeypatch):
    monkeypatch.setattr(run, "LOG_S", 0.2)
    monkeypatch.setattr(run, "TERMINAL_S", 0.2)
    for in_place in (False, True):
        progress, stream = progress_of(three_jobs(), in_place)
        progress.begin()
        progress.emit(record("job_started", jobs=[1, 2]))
        time.sleep(0.9)
        progress.end()
        *shown, last = re.split(r"\n|" + re.escape(ERASE_LINE), stream.getvalue().strip())
        shown = [line for line in shown if line]
        assert 2 <= len(shown) <= 6
        assert shown[-1].endswith("perhaps 1 min left, 0 of 3 jobs; now train × 2")
        assert last.endswith("0 of 3 jobs done in 1 s")
        assert stream.getvalue().count("\n") == (1 if in_place else len(shown) + 1)


def test_jobs_that_an_earlier_run_finished_count_with_their_benchmarks(tmp_path):
    benchmark = tmp_path / "train.tsv"
    benchmark.write_text("s\th:m:s\tmax_rss\n30.0000\t0:00:30\t-\n")
    planned = three_jobs()
    planned[1] = Planned(Job("train"), "train", benchmark=benchmark, is_finished=True)
    planned[3] = Planned(Job("train"), "train")
    progress, _ = progress_of(planned)
    assert progress.first_estimate() == (
        "2 jobs to do (1 already there), about 30 s by the times of those"
    )
    assert benchmarked_s(tmp_path / "none.tsv") is None
    benchmark.write_text("")
    assert benchmarked_s(benchmark) is None


def test_a_failed_job_is_said_to_end_the_run_unless_the_run_goes_on(monkeypatch):
    monkeypatch.setattr(run, "LOG_S", 0.1)
    for stops in (True, False):
        progress, stream = progress_of(three_jobs(), stops_at_failure=stops)
        progress.emit(record("job_started", jobs=[1, 2]))
        progress.emit(record("job_error", jobid=1))
        progress.begin()
        time.sleep(0.3)
        progress.close()
        said = "a job failed; waiting for what still runs: train"
        assert (said in stream.getvalue()) == stops


def test_a_line_is_cut_to_the_terminal_and_gives_way_to_other_messages(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    stream = io.StringIO()
    line = Line(stream, in_place=True)
    line.show("x" * 100)
    assert stream.getvalue() == ERASE_LINE + "x" * 19
    line.clear()
    line.clear()
    assert stream.getvalue() == ERASE_LINE + "x" * 19 + ERASE_LINE


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (Estimate(0.341, 2900, "this run"), "34 % done, about 48 min left"),
        (Estimate(0.999, 3.0, "this run"), "99 % done, about 5 s left"),
        (
            Estimate(0.001, 4100, "reference"),
            " 0 % done, perhaps 1 h 10 min left",
        ),
        (Estimate(0.5, 100, "guess"), "estimating the time left"),
    ],
)
def test_how_far_a_run_is_in_words(estimate, text):
    assert how_far(estimate) == text


def test_what_trainings_and_renderings_say_of_their_time_is_understood(
    tmp_path, caplog, monkeypatch
):
    caplog.set_level(logging.INFO)
    began = time.time() - 20
    Progress(n_epochs=4, n_images=100, started=time.perf_counter() - 20).report(1, 0, 0.5)
    monkeypatch.setattr("nbv.data.depth_images._SECONDS_BETWEEN_LINES", 0.0)
    images = (np.zeros((2, 4, 4), np.uint8) for _ in range(2))
    write_depth(tmp_path / "a.npy", tmp_path / "a.json", ["a", "b"], images, (2, 4, 4))
    said = [each.getMessage() for each in caplog.records]
    log = tmp_path / "job.log"
    for message, expected in ((said[0], 60), (said[1], 0)):
        log.write_text(f"[10:00:00 train] loading\n[10:00:05 train] {message}\n")
        now = log.stat().st_mtime + 2
        assert said_left_s(log, began, now) == pytest.approx(max(expected - 2, 0), abs=0.1)
        assert said_left_s(log, now, now) is None
    log.write_text("[10:00:00 train] training on 80 images\n")
    assert said_left_s(log, began, time.time()) is None
    assert said_left_s(tmp_path / "none.log", began, time.time()) is None


JOB_FAILED = "RuleException:\nCalledProcessError in file 'x.smk', line 3:\nCommand 'python x.py' {}"


@pytest.mark.parametrize(
    ("level", "message", "is_shown"),
    [
        (logging.INFO, "Select jobs to execute...", False),
        (logging.INFO, "Nothing to be done (all requested files are present).", True),
        (logging.WARNING, "Falling back to greedy scheduler", True),
        (logging.ERROR, "MissingOutputException in rule x", True),
        (logging.ERROR, JOB_FAILED.format("returned non-zero exit status 1."), False),
        (logging.ERROR, JOB_FAILED.format("died with <Signals.SIGSEGV: 11>."), True),
        (logging.ERROR, "WorkflowError:\nAt least one job did not complete successfully.", False),
    ],
)
def test_warnings_and_errors_are_shown_but_not_what_a_job_has_said_itself(level, message, is_shown):
    made = logging.makeLogRecord({"levelno": level, "msg": message})
    assert tells_the_user(made) == is_shown
    rooms = []
    running = WithoutChatter(lambda: True, lambda: rooms.append(1))
    assert (running.filter(made), len(rooms)) == (is_shown, int(is_shown))
    # What is no run, such as a dry run, is there to be read.
    assert WithoutChatter(lambda: False, lambda: None).filter(made)

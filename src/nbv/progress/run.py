"""Following a run by what Snakemake logs, and saying how far it is."""

from __future__ import annotations

import logging
import re
import threading
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from nbv.labels import counted, duration
from nbv.progress.estimate import Estimate, Job, Seen, estimate
from nbv.progress.line import Line, how_far, time_left

TERMINAL_S, LOG_S = 1.0, 60.0
"""Seconds between two lines."""
_ESTIMATE_S = 5.0
_SAID_LEFT = re.compile(r", (\d+) s left$")
_TAIL_BYTES = 500


@dataclass(frozen=True)
class Planned:
    """A job, and where it says what it does.

    Attributes
    ----------
    job : Job
    name : str
        Of its rule.
    log, benchmark : Path or None
        The benchmark may be of an earlier run of the same command, which then need not be repeated.
    is_finished : bool
        Whether an earlier run made its files.
    """

    job: Job
    name: str
    log: Path | None = None
    benchmark: Path | None = None
    is_finished: bool = False


class RunProgress(logging.Handler):
    """Says in one line how far a run is; on a terminal every second, in a log every minute.

    Parameters
    ----------
    planned : mapping of int to Planned
        All jobs by Snakemake's number.
    cores : int
        Jobs that can run at once.
    line : Line
    stops_at_failure : bool
        Whether no job starts any more after one has failed.
    """

    def __init__(
        self, planned: Mapping[int, Planned], cores: int, line: Line, stops_at_failure: bool
    ) -> None:
        super().__init__()
        self._planned, self._cores, self._line = planned, cores, line
        self._jobs = {number: each.job for number, each in planned.items()}
        self._stops_at_failure = stops_at_failure
        self._began = time.time()
        self._started: dict[int, float] = {}
        self._finished = {
            number: benchmarked_s(each.benchmark)
            for number, each in planned.items()
            if each.is_finished
        }
        self._failed: set[int] = set()
        self._estimate, self._estimated = self._estimate_at(self._began), self._began
        self._end = threading.Event()
        self._ticker = threading.Thread(target=self._tick, daemon=True)

    def begin(self) -> None:
        """Start to show the line."""
        self._ticker.start()

    def first_estimate(self) -> str:
        """Say how much there is to do, before anything runs."""
        n_left = len(self._planned) - len(self._finished)
        there = f" ({len(self._finished):,} already there)" if self._finished else ""
        to_do = f"{n_left:,} {'job' if n_left == 1 else 'jobs'} to do{there}"
        guessed = self._estimate.n_guessed
        # A median of few jobs says nothing of the many others, which may be the long ones.
        if self._estimate.basis == "guess" or 2 * guessed > n_left:
            return to_do
        source = {"reference": "reference run's times", "this run": "times of those"}
        unknown = f" ({counted(guessed, 'job')} guessed)" if guessed else ""
        usual = f"about {time_left(self._estimate)} by the {source[self._estimate.basis]}"
        return f"{to_do}, {usual}{unknown}"

    def emit(self, record: logging.LogRecord) -> None:
        """Take note of a job that starts, ends or fails."""
        event = getattr(record, "event", None)
        if event == "job_started":
            for number in self._planned.keys() & set(record.__dict__["jobs"]):
                self._failed.discard(number)
                self._started[number] = record.created
        elif event == "job_finished":
            self._note_end(record.__dict__["job_id"], record.created)
        elif event == "job_error" and record.__dict__["jobid"] in self._planned:
            self._started.pop(record.__dict__["jobid"], None)
            self._failed.add(record.__dict__["jobid"])

    def end(self) -> None:
        """Show the last line, which stays."""
        self._stop()
        took = duration(time.time() - self._began)
        if len(self._finished) == len(self._planned):
            text = f"100 % done in {took}, {self._counts()}"
        else:
            text = f"{self._counts()} done in {took}"
        self._line.leave(self._stamped(text))

    def close(self) -> None:
        """Show nothing any more."""
        self._stop()
        self._line.clear()
        super().close()

    def _note_end(self, number: int, now: float) -> None:
        if number not in self._planned:
            return
        started = self._started.pop(number, None)
        if started is None:
            # The jobs of a group start one after the other, unseen.
            self._finished[number] = benchmarked_s(self._planned[number].benchmark)
        else:
            self._finished[number] = now - started

    def _stop(self) -> None:
        self._end.set()
        if self._ticker.is_alive():
            self._ticker.join()

    def _tick(self) -> None:
        pause_s = TERMINAL_S if self._line.in_place else LOG_S
        if self._line.in_place:
            self._line.show(self._stamped(self._text()))
        while not self._end.wait(pause_s):
            self._line.show(self._stamped(self._text()))

    def _text(self) -> str:
        now = time.time()
        if now - self._estimated >= _ESTIMATE_S:
            self._estimate, self._estimated = self._estimate_at(now), now
        running = Counter(self._planned[number].name for number in [*self._started])
        busy = ", ".join(f"{name} × {n}" if n > 1 else name for name, n in sorted(running.items()))
        if self._failed and self._stops_at_failure:
            return f"a job failed; waiting for what still runs: {busy}"
        now_running = f"; now {busy}" if busy else ""
        return f"{how_far(self._estimate)}, {self._counts()}{now_running}"

    def _counts(self) -> str:
        return f"{len(self._finished):,} of {len(self._planned):,} jobs"

    @staticmethod
    def _stamped(text: str) -> str:
        return f"[{time.strftime('%H:%M:%S')} nbv] {text}"

    def _estimate_at(self, now: float) -> Estimate:
        # Copies: the scheduler's thread writes the originals.
        started = self._started.copy()
        said = {
            number: left_s
            for number, since in started.items()
            if (left_s := said_left_s(self._planned[number].log, since, now)) is not None
        }
        running = {number: now - since for number, since in started.items()}
        seen = Seen(self._finished.copy(), running, said, self._failed.copy())
        return estimate(self._jobs, seen, self._cores)


def benchmarked_s(path: Path | None) -> float | None:
    """Return the wall-clock seconds of a benchmark file; None where there is none to read."""
    if path is None or not path.is_file():
        return None
    try:
        return float(pd.read_csv(path, sep="\t")["s"].iloc[-1])
    except (OSError, ValueError, KeyError, IndexError):
        return None


def said_left_s(log: Path | None, since: float, now: float) -> float | None:
    """Return how much longer a job expects to take, by the last line of its log.

    Parameters
    ----------
    log : Path or None
    since, now : float
        When the job started and what time it is, in seconds since 1970. What was written before the
        start is of an earlier run; what was written since then has become less.

    Returns
    -------
    float or None
        Seconds, 0 or more. None where the last line says nothing of it.
    """
    try:
        if log is None or (written := log.stat().st_mtime) < since:
            return None
        with log.open("rb") as file:
            file.seek(max(log.stat().st_size - _TAIL_BYTES, 0))
            tail = file.read().decode("utf-8", errors="replace")
    except OSError:
        return None
    said = _SAID_LEFT.search(tail.rstrip("\n"))
    return max(float(said[1]) - (now - written), 0.0) if said else None

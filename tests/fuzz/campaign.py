"""Damaged files, one after the other, read by processes that may not harm anything."""

from __future__ import annotations

import json
import math
import os
import queue
import shutil
import subprocess
import sys
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tests.fuzz.mutations import mutate
from tests.fuzz.readers import READERS, ROOT

OUTCOMES = ("result", "refused", "failed")


class Case(NamedTuple):
    """One file: its reader's name and its number decide what is damaged; below 0 nothing is."""

    reader: str
    number: int


class Outcome(NamedTuple):
    """What came of a case: one of `OUTCOMES`, and a line about it."""

    case: Case
    outcome: str
    detail: str


def cases(n: int) -> list[Case]:
    """Return each reader's valid file and n damaged ones, to within one as many for each reader."""
    names = list(READERS)
    valid = [Case(name, -1) for name in names]
    return [*valid, *(Case(names[i % len(names)], i // len(names)) for i in range(n))]


class Campaign:
    """Makes cases below a folder and has them read.

    Parameters
    ----------
    folder : pathlib.Path
        Empty. Files of failed cases are kept in its subfolder ``failed``.
    seed : int
        Decides, with a case, what is damaged.
    n_workers : int
        Processes that read at the same time.
    """

    def __init__(self, folder: Path, seed: int, n_workers: int = 1) -> None:
        self._folder, self._seed, self._n_workers = folder, seed, n_workers
        self._valid: dict[str, bytes] = {}
        for name, reader in READERS.items():
            path = folder / "valid" / name / reader.file
            path.parent.mkdir(parents=True)
            reader.make(path)
            self._valid[name] = path.read_bytes()

    def run(self, wanted: Sequence[Case], deadline: float = math.inf) -> Iterator[Outcome]:
        """Yield the outcome of each case as it comes; none is begun after `time.monotonic`."""
        outcomes: queue.SimpleQueue[Outcome | None] = queue.SimpleQueue()

        def work(number: int) -> None:
            try:
                with Worker(self._folder / f"worker{number}") as worker:
                    for case in wanted[number :: self._n_workers]:
                        if time.monotonic() < deadline:
                            outcomes.put(self._outcome(worker, case))
            finally:
                outcomes.put(None)

        with ThreadPoolExecutor(self._n_workers) as pool:
            ended = [pool.submit(work, number) for number in range(self._n_workers)]
            for _ in ended:
                yield from iter(outcomes.get, None)
            for future in ended:
                future.result()

    def write_case(self, case: Case, folder: Path) -> Path:
        """Write a case's damaged file, and what reading it needs, below a folder."""
        reader = READERS[case.reader]
        shutil.copytree(self._folder / "valid" / case.reader, folder)
        path = folder / reader.file
        if case.number < 0:
            return path
        rng = np.random.default_rng([self._seed, zlib.crc32(case.reader.encode()), case.number])
        others = [data for name, data in self._valid.items() if name != case.reader]
        path.write_bytes(mutate(self._valid[case.reader], others, rng))
        return path

    def _outcome(self, worker: Worker, case: Case) -> Outcome:
        folder = worker.folder / "case"
        path = self.write_case(case, folder)
        found, detail = worker.ask(case.reader, path)
        if case.number < 0 and found == "refused":
            found = "failed"
        outcome = Outcome(case, found, detail)
        if outcome.outcome == "failed":
            kept = f"seed{self._seed}-{case.reader}-{case.number}".replace(" ", "-")
            (self._folder / "failed").mkdir(exist_ok=True)
            shutil.copy(path, self._folder / "failed" / f"{kept}{path.suffix}")
        shutil.rmtree(folder)
        return outcome


class Worker:
    """A process of `tests.fuzz.worker`, started again where a file ended it."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self.folder, self._process = folder, None
        self._notes = folder / "notes.txt"

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def ask(self, name: str, path: Path) -> tuple[str, str]:
        """Return the outcome of a file, and a line about it."""
        process = self._running()
        try:
            process.stdin.write(json.dumps([name, str(path)]) + "\n")
            process.stdin.flush()
            outcome, detail = json.loads(process.stdout.readline() or "null") or ("", "")
        except BrokenPipeError:
            outcome = ""
        if not outcome:
            status = process.wait()
            self._end()
            return "failed", f"the reader ended with status {status}: " + self._last_error()
        if self._notes.exists() and (notes := self._notes.read_text()):
            self._notes.write_text("")
            return "failed", f"forbidden: {notes.splitlines()[0]}"
        return outcome, detail

    def environment(self) -> dict[str, str]:
        """Return the environment in which Python loads the guard, and so do its children.

        Nothing counts their coverage, which is written elsewhere.
        """
        inherited = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE_")}
        paths = [str(ROOT / "tests" / "fuzz" / "guard"), str(ROOT), os.environ.get("PYTHONPATH")]
        return inherited | {
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            "NBV_FUZZ_ALLOWED": str(self.folder.parent),
            "NBV_FUZZ_NOTES": str(self._notes),
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
        }

    def _last_error(self) -> str:
        lines = (self.folder / "stderr.txt").read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            with (self.folder / "stderr.txt").open("wb") as errors:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "tests.fuzz.worker"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    text=True,
                    cwd=self.folder,
                    env=self.environment(),
                )
        return self._process

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def table(outcomes: Iterable[Outcome]) -> str:
    """Return a line for each kind of file: its cases, and how they ended."""
    counts: dict[str, dict[str, int]] = {}
    for outcome in outcomes:
        of_reader = counts.setdefault(outcome.case.reader, dict.fromkeys(OUTCOMES, 0))
        of_reader[outcome.outcome] += 1
    total = {name: sum(c[name] for c in counts.values()) for name in OUTCOMES}
    lines = [f"{'kind':15}{'cases':>7}{'results':>9}{'refusals':>10}{'failures':>10}"]
    for reader, c in [*sorted(counts.items()), ("all", total)]:
        numbers = (sum(c.values()), c["result"], c["refused"], c["failed"])
        lines.append("{:15}{:7}{:9}{:10}{:10}".format(reader, *numbers))
    return "\n".join(lines)

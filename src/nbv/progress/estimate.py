"""How long a run will still take, from what its own jobs took.

Jobs of one kind take time in proportion to their size, and go on as the last ones did. Where no job
of a kind is known, a reference run's time stands in, as much longer or shorter as of other kinds of
job here; where there is none, the median of all other jobs. What is left is then put on the cores,
as the scheduler will.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Literal

START_S = 0.5
"""Seconds that any job takes, however small: Python starts and imports."""

# Sums of the same times may differ in their last digit.
_AT_ONCE_S = 1e-6

# What a job weighs less for each one of its kind that ended after it, because other work on the
# machine comes and goes. A half is left after three.
_KEPT = 0.8

Basis = Literal["this run", "reference", "guess"]


@dataclass(frozen=True)
class Job:
    """A job of the workflow.

    Attributes
    ----------
    kind : str
        What it runs. Jobs of one kind take time in proportion to their size.
    size : float
        Positive; compared with other jobs of the kind only, such as the images that are trained on.
    needs : frozenset of int
        The jobs that it waits for.
    priority : int
        Of the jobs that could start, the one with the highest priority starts first.
    reference_s : float, optional
        What a job of this size took in a reference run, in seconds.
    """

    kind: str
    size: float = 1.0
    needs: frozenset[int] = frozenset()
    priority: int = 0
    reference_s: float | None = None


@dataclass(frozen=True)
class Seen:
    """What is known of the jobs of a run at one moment.

    Attributes
    ----------
    finished : mapping of int to float or None
        Wall-clock seconds, in the order in which the jobs ended; None where nobody timed one.
    running : mapping of int to float
        Seconds since the job's start.
    said_left : mapping of int to float
        How many seconds longer a running job itself expects to take, where it says so.
    failed : collection of int
        They end no more, and what waits for them does not start.
    """

    finished: Mapping[int, float | None] = field(default_factory=dict)
    running: Mapping[int, float] = field(default_factory=dict)
    said_left: Mapping[int, float] = field(default_factory=dict)
    failed: Collection[int] = ()


@dataclass(frozen=True)
class Estimate:
    """How far a run is.

    Attributes
    ----------
    done : float
        Share of the work that is done, in seconds of single jobs: 0 to 1, and 1 only where nothing
        is left.
    left_s : float
        Seconds until the last job ends.
    basis : str
        What most of the time left goes by: times of ``this run``, of the ``reference`` run, or a
        ``guess``: a job of which neither is known is taken to be like the median of the others.
    n_guessed: int
        Jobs that are left and of which neither is known.
    """

    done: float
    left_s: float
    basis: Basis
    n_guessed: int = 0


def estimate(jobs: Mapping[int, Job], seen: Seen, cores: int) -> Estimate:
    """Say how far a run is, and when its last job will end.

    Parameters
    ----------
    jobs : mapping of int to Job
        All jobs of the run, with those that earlier runs of the same command finished.
    seen : Seen
    cores : int
        Jobs that can run at once, 1 or more.
    """
    expected = _expected(jobs, _rates(jobs, seen))
    left: dict[int, float] = {}
    done_s = 0.0
    for number, (expected_s, _) in expected.items():
        if number in seen.finished:
            took_s = seen.finished[number]
            done_s += expected_s if took_s is None else took_s
            continue
        elapsed_s = seen.running.get(number, 0.0)
        done_s += min(elapsed_s, expected_s)
        left_s = seen.said_left.get(number, expected_s - elapsed_s)
        # A job that takes longer than expected still has something to do.
        left[number] = left_s if left_s > 0 else START_S
    ends = _ends(jobs, left, seen, cores)
    work_s: dict[Basis, float] = {"this run": 0.0, "reference": 0.0, "guess": 0.0}
    for number in ends:
        work_s[expected[number][1]] += left[number]
    return Estimate(
        done=done_s / (done_s + sum(left.values())) if left else 1.0,
        left_s=max(ends.values(), default=0.0),
        basis=max(work_s, key=work_s.__getitem__),
        n_guessed=sum(expected[number][1] == "guess" for number in ends),
    )


def _rates(jobs: Mapping[int, Job], seen: Seen) -> dict[str, float]:
    """Return the seconds beyond the start for a unit of size, of each kind that is known."""
    seconds: dict[str, float] = defaultdict(float)
    sizes: dict[str, float] = defaultdict(float)
    known = {number: took_s for number, took_s in seen.finished.items() if took_s is not None}
    known |= {number: seen.running[number] + left_s for number, left_s in seen.said_left.items()}
    for number, took_s in known.items():
        job = jobs[number]
        seconds[job.kind] = _KEPT * seconds[job.kind] + max(took_s - START_S, 0.0)
        sizes[job.kind] = _KEPT * sizes[job.kind] + job.size
    return {kind: seconds[kind] / sizes[kind] for kind in sizes}


def _expected(
    jobs: Mapping[int, Job], rates: Mapping[str, float]
) -> dict[int, tuple[float, Basis]]:
    """Return how many seconds each job takes in all, and by whose times."""
    measured = {
        number: START_S + rates[job.kind] * job.size
        for number, job in jobs.items()
        if job.kind in rates
    }
    speed = _against_reference(jobs, measured)
    expected: dict[int, tuple[float, Basis]] = {}
    for number, job in jobs.items():
        if number in measured:
            expected[number] = measured[number], "this run"
        elif job.reference_s is not None:
            expected[number] = speed * job.reference_s, "reference"
    known = [seconds for seconds, _ in expected.values()]
    guess: tuple[float, Basis] = median(known) if known else START_S, "guess"
    return {number: expected.get(number, guess) for number in jobs}


def _against_reference(jobs: Mapping[int, Job], measured: Mapping[int, float]) -> float:
    """Return how many times as long as in the reference run the median kind of job takes."""
    times = {
        job.kind: measured[number] / job.reference_s
        for number, job in jobs.items()
        if number in measured and job.reference_s
    }
    return median(times.values()) if times else 1.0


def _ends(
    jobs: Mapping[int, Job], left: Mapping[int, float], seen: Seen, cores: int
) -> dict[int, float]:
    """Return when each job that is left will end: a free core takes the next job that is ready.

    Those that wait for a failed job are left out.
    """
    waits_for = {
        number: len([need for need in jobs[number].needs if need in left]) for number in left
    }
    followers = defaultdict(list)
    for number in left:
        for need in jobs[number].needs:
            followers[need].append(number)
    running = [(left[number], number) for number in seen.running if number in left]
    heapq.heapify(running)
    ready = [
        (-jobs[number].priority, -left[number], number)
        for number in left
        if not waits_for[number] and number not in seen.running and number not in seen.failed
    ]
    heapq.heapify(ready)
    now, ends = 0.0, {}
    while running or ready:
        while ready and len(running) < cores:
            *_, number = heapq.heappop(ready)
            heapq.heappush(running, (now + left[number], number))
        now = running[0][0]
        # Jobs that end at once free their cores together: of what waited for them, the highest
        # priority starts first.
        while running and running[0][0] <= now + _AT_ONCE_S:
            ends_at, number = heapq.heappop(running)
            ends[number] = ends_at
            for follower in followers[number]:
                waits_for[follower] -= 1
                if not waits_for[follower]:
                    order = (-jobs[follower].priority, -left[follower], follower)
                    heapq.heappush(ready, order)
    return ends


def with_reference(
    jobs: Mapping[int, Job], mean_s: Mapping[str, float], mean_size: Mapping[str, float]
) -> dict[int, Job]:
    """Give each job the time that one of its size took in a reference run.

    Parameters
    ----------
    jobs : mapping of int to Job
    mean_s, mean_size : mapping of str to float
        Of the reference run's jobs, by kind: seconds, and size. Where a kind has no mean size, its
        jobs here are taken to be of the reference's size on average.
    """
    sizes = defaultdict(list)
    for job in jobs.values():
        sizes[job.kind].append(job.size)
    here = {kind: sum(each) / len(each) for kind, each in sizes.items()}
    return {
        number: replace(job, reference_s=_reference_s(job, mean_s, {**here, **mean_size}))
        for number, job in jobs.items()
    }


def _reference_s(
    job: Job, mean_s: Mapping[str, float], mean_size: Mapping[str, float]
) -> float | None:
    if job.kind not in mean_s:
        return None
    return START_S + max(mean_s[job.kind] - START_S, 0.0) * job.size / mean_size[job.kind]

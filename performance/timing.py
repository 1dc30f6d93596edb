"""Ratios on a machine that has other things to do: take turns, compare neighbours in time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Work = Callable[[], object]


def seconds(work: Work) -> float:
    """Return the wall-clock time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


@dataclass(frozen=True)
class Times:
    """Times of several works that took turns, one row a round, one column a work, in seconds."""

    rounds: NDArray[np.float64]

    def typical(self, column: int) -> float:
        """Return the median time of one work."""
        return float(np.median(self.rounds[:, column]))

    def ratio(self, numerator: int, denominator: int) -> float:
        """Return the median, over rounds, of one work's time over another's in the same round."""
        return median_ratio(self.rounds[:, numerator], self.rounds[:, denominator])


def median_ratio(numerators: ArrayLike, denominators: ArrayLike) -> float:
    """Return the median of the ratios of neighbours: what slows both of a pair cancels."""
    return float(np.median(np.divide(numerators, denominators)))


def take_turns(
    works: Sequence[Work], n_rounds: int, warm_up: bool = True, in_a_row: int = 1
) -> Times:
    """Time works in turn: A B A B ...; unless `warm_up` is false, each is called once before.

    Works of a millisecond push each other out of the processor's cache. With `in_a_row` a round has
    so many calls of each, one after the other, and their median counts.
    """
    if warm_up:
        for work in works:
            work()
    rounds = [
        [np.median([seconds(work) for _ in range(in_a_row)]) for work in works]
        for _ in range(n_rounds)
    ]
    return Times(np.array(rounds))


@contextmanager
def on_one_core() -> Iterator[None]:
    """Keep the process, and threads that libraries start meanwhile, on one core where possible."""
    if not hasattr(os, "sched_setaffinity"):  # Linux alone has it.
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)

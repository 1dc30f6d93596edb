"""One line at the end of a terminal, written over and over; in a log, a line now and then."""

from __future__ import annotations

import math
import os
import shutil
import threading
from typing import TextIO

from nbv.experiment.jobs import ERASE_LINE
from nbv.labels import duration
from nbv.progress.estimate import Estimate


class Line:
    """What is written last on a terminal.

    Parameters
    ----------
    stream : text file
        Where it is written. Where that is no terminal, each line stays.
    in_place : bool
        Whether a line replaces the one before. Nothing else can be written on its row then.
    """

    def __init__(self, stream: TextIO, in_place: bool) -> None:
        self.in_place = in_place
        self._stream = stream
        self._lock = threading.Lock()
        self._is_shown = False

    def show(self, text: str) -> None:
        """Write the line, in place of the one before where that is asked for."""
        if not self.in_place:
            self.leave(text)
            return
        with self._lock:
            self._stream.write(ERASE_LINE + text[: self._width() - 1])
            self._stream.flush()
            self._is_shown = True

    def leave(self, text: str) -> None:
        """Write a line that stays, in place of the one before."""
        self.clear()
        with self._lock:
            self._stream.write(f"{text}\n")
            self._stream.flush()

    def clear(self) -> None:
        """Make room for something else to be written."""
        with self._lock:
            if self._is_shown:
                self._stream.write(ERASE_LINE)
                self._stream.flush()
                self._is_shown = False

    def _width(self) -> int:
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or 80
        except OSError:
            return shutil.get_terminal_size().columns


def how_far(estimate: Estimate) -> str:
    """Say how much of a run is done and how long it still takes, as far as that is known.

    ``34 % done, about 48 min left``; ``perhaps`` where most of it goes by the reference run.
    """
    if estimate.basis == "guess":
        return "estimating the time left"
    # 100 % is for the end.
    percent = min(int(100 * estimate.done), 99)
    how_sure = "perhaps" if estimate.basis == "reference" else "about"
    return f"{percent:2d} % done, {how_sure} {time_left(estimate)} left"


def time_left(estimate: Estimate) -> str:
    """Return the time left, rounded to what can be known of it: the last digit does not flicker."""
    step = next(step for limit, step in _STEPS_S if estimate.left_s < limit)
    return duration(step * max(round(estimate.left_s / step), 1))


# Up to how many seconds it is rounded to how many.
_STEPS_S = ((60.0, 5.0), (600.0, 30.0), (3600.0, 60.0), (math.inf, 300.0))

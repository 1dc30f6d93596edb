"""What became of an object's detections at calibration, and so for which estimates it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nbv.labels import counted


@dataclass(frozen=True)
class Detections:
    """An object's detections that are no calibration pairs, and why.

    Attributes
    ----------
    farther, surpassed : sequence of float
        Scores of the detections that are farther than `nearest_mm` from every instance, and of
        those of an instance that has another one of a better score.
    n_missed : int
        Instances without an estimate, in the images that have estimates.
    n_failed : int
        Answers of the estimator without a pose.
    nearest_mm : float or None
        None for a table of pairs, which says nothing of other detections.
    least_score : float or None
        Detections of lower scores were left out.
    """

    farther: Sequence[float]
    surpassed: Sequence[float]
    n_missed: int
    n_failed: int
    nearest_mm: float | None
    least_score: float | None

    def holds_where(self, matched: ArrayLike, score: float | None = None) -> str | None:
        """Return for which share of the detections with at least a score calibration holds.

        `matched` (n,) are the scores of the calibration pairs.
        """
        if self.nearest_mm is None:
            return None
        least = -np.inf if score is None else score
        right, far, other = (
            int(np.sum(np.greater_equal(scores, least)))
            for scores in (matched, self.farther, self.surpassed)
        )
        which = "" if score is None else " with at least this score"
        failed = f"; {counted(self.n_failed, 'answer')} without a pose" if self.n_failed else ""
        return (
            f"holds where the position is right: {right} of "
            f"{counted(right + far + other, 'detection')}{which} ({far} farther than "
            f"{self.nearest_mm:g} mm, {other} with a better one beside it); {self.n_missed} of "
            f"{counted(np.size(matched) + self.n_missed, 'instance')} without an estimate{failed}"
        )

    def warnings(self, score: float | None) -> tuple[str, ...]:
        """Return a warning if a score is below `least_score`."""
        if score is None or self.least_score is None or score >= self.least_score:
            return ()
        return (
            f"the score {score:g} is below {self.least_score:g}, the least of calibration: what is "
            "expected is that of better estimates",
        )

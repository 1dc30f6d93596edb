"""What became of an object's detections at calibration, and so for which estimates it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nbv.core.orientations.group import Array
from nbv.labels import counted


@dataclass(frozen=True)
class Detections:
    """An object's detections that are no calibration pairs, and why.

    Attributes
    ----------
    farther, surpassed : ndarray (n,)
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

    farther: Array
    surpassed: Array
    n_missed: int
    n_failed: int
    nearest_mm: float | None
    least_score: float | None

    @classmethod
    def of(cls, entry: Mapping[str, Any]) -> Detections:
        """Return the detections of an entry of `as_json`."""
        names = ("farther", "surpassed")
        return cls(**dict(entry) | {n: np.array(entry[n], dtype=np.float64) for n in names})

    def as_json(self) -> dict[str, Any]:
        """Return the attributes as a JSON object."""
        return vars(self) | {n: getattr(self, n).tolist() for n in ("farther", "surpassed")}

    def counts(self) -> dict[str, int]:
        """Return the number of detections and of instances by reason."""
        n_others = {"n_farther": len(self.farther), "n_surpassed": len(self.surpassed)}
        return n_others | {"n_missed": self.n_missed, "n_failed": self.n_failed}

    def warning(self, score: float | None) -> tuple[str, ...]:
        """Return a warning if a score is below `least_score`."""
        if score is None or self.least_score is None or score >= self.least_score:
            return ()
        return (
            f"the score {score:g} is below {self.least_score:g}, the least of calibration: what is "
            "expected is that of better estimates",
        )

    def holds_where(self, matched: Array, score: float | None = None) -> str | None:
        """Return for which share of detections calibration holds, as a sentence.

        Parameters
        ----------
        matched : ndarray (n,)
            Scores of the calibration pairs.
        score : float, optional
            Only detections with at least this score count; all by default.
        """
        if self.nearest_mm is None:
            return None
        least = -np.inf if score is None else score
        right, far, other = (
            int((scores >= least).sum()) for scores in (matched, self.farther, self.surpassed)
        )
        which = "" if score is None else " with at least this score"
        n_instances = len(matched) + self.n_missed
        failed = f"; {counted(self.n_failed, 'answer')} without a pose" if self.n_failed else ""
        return (
            f"holds where the position is right: {right} of "
            f"{counted(right + far + other, 'detection')}{which} ({far} farther than "
            f"{self.nearest_mm:g} mm, {other} with a better one beside it); {self.n_missed} of "
            f"{counted(n_instances, 'instance')} without an estimate{failed}"
        )

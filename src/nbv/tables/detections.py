"""What became of an object's detections at calibration, and so for which estimates it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from nbv.labels import counted


@dataclass(frozen=True)
class Detections:
    """What became of an object's detections.

    There are scores of those that are calibration pairs (`matched`), of those that are `farther`
    than `nearest_mm` from every instance, and of those beside one of a better score (`surpassed`).
    A table of pairs says nothing of other detections: there `nearest_mm` is None. Detections below
    `least_score` were left out. `n_missed` instances, in images that have estimates, have none;
    `n_failed` answers of the estimator are without a pose.
    """

    matched: Sequence[float] = ()
    farther: Sequence[float] = ()
    surpassed: Sequence[float] = ()
    n_missed: int = 0
    n_failed: int = 0
    nearest_mm: float | None = None
    least_score: float | None = None

    def holds_where(self, score: float | None = None) -> str | None:
        """Return for which share of the detections with at least a score calibration holds."""
        if self.nearest_mm is None:
            return None
        right, far, other = (
            sum(score is None or each >= score for each in scores)
            for scores in (self.matched, self.farther, self.surpassed)
        )
        which = "" if score is None else " with at least this score"
        failed = f"; {counted(self.n_failed, 'answer')} without a pose" if self.n_failed else ""
        return (
            f"holds where the position is right: {right} of "
            f"{counted(right + far + other, 'detection')}{which} ({far} farther than "
            f"{self.nearest_mm:g} mm, {other} with a better one beside it); {self.n_missed} of "
            f"{counted(len(self.matched) + self.n_missed, 'instance')} without an estimate{failed}"
        )

    def warnings(self, score: float | None) -> tuple[str, ...]:
        """Return a warning if a score is below `least_score`."""
        if score is None or self.least_score is None or score >= self.least_score:
            return ()
        return (
            f"the score {score:g} is below {self.least_score:g}, the least of calibration: what is "
            "expected is that of better estimates",
        )

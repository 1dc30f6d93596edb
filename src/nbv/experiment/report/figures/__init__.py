"""The paper's figures from our results, and four more: what each shows and needs.

Every start of the workflow reads this, so that matplotlib is not imported here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class FigureKind:
    """A figure: its caption, and what it needs of `nbv.experiment.report.figures.inputs`.

    ``needs`` names some of ``depth``, ``objects`` and ``lookups``; all need the evaluations.
    """

    caption: str
    needs: tuple[str, ...] = ()


FIGURES: Mapping[str, FigureKind] = {
    "steps": FigureKind(
        "The method in three steps. One view fits many poses. The lookup table's row for its "
        "estimate holds the cost of each rotation; the camera takes the one of least cost. Both "
        "views together fit few poses. The object has the median single-view error of its fold, "
        "seen from where that error is largest.",
        ("depth", "objects", "lookups"),
    ),
    "figure2": FigureKind(
        "Figure 2. The criterion (the paper's: ambiguity) selects the next viewpoint: an initial "
        "view from where the category's single-view error is largest, the recommended, the "
        "opposite and the worst next view, and the cost of each, on an axis that does not start "
        "at 0. The object has the median single-view error of its fold.",
        ("depth", "objects", "lookups"),
    ),
    "figure3": FigureKind(
        "Figure 3. The idea: how widely the pose is spread given one view's estimate (top), how "
        "widely the paper's Eq. 3 expects it to be spread with a second view, for the recommended "
        "and the worst rotation (middle), and what is left once the second view's estimate is in "
        "(bottom; both estimates combined by Bayes' rule).",
        ("depth", "objects", "lookups"),
    ),
    "figure5": FigureKind(
        "Figure 5. Depth images of each category. Nearer is brighter; white is background.",
        ("depth", "objects"),
    ),
    "figure6": FigureKind(
        "Figure 6. Depth images at different elevations. Nearer is brighter; white is background.",
        ("depth", "objects"),
    ),
    "figure7": FigureKind(
        "Figure 7. The next view of each method for the initial image of Figure 2, and the pose "
        "estimated from both.",
        ("depth", "objects"),
    ),
    "figure8": FigureKind(
        "Figure 8. The four groups of initial viewpoints of Table 5.",
        ("depth", "objects"),
    ),
    "figure9": FigureKind(
        "Figure 9. Pose errors by category and method. Above as in the paper (minimum, quartiles, "
        "median, maximum); below with whiskers to the 5th and 95th percentile. No point is left "
        "out as an outlier, and none is drawn singly.",
    ),
    "pea": FigureKind(
        "Pose estimation accuracy: the fraction of images with an error below the threshold. The "
        "pAUC is the area below a curve on a linear axis.",
    ),
    "azimuth": FigureKind(
        "Mean error by initial azimuth, a running mean over 15°. Dotted lines bound the viewpoint "
        "groups.",
    ),
    "heatmaps": FigureKind(
        "One fold's lookup table: the true viewpoint's likelihood given the estimate, and the cost "
        "of each rotation with the recommended one marked. A good estimator's likelihood lies on "
        "the dotted diagonal.",
        ("lookups",),
    ),
}
"""Figures by name, in the order of a report."""

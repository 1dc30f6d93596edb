"""The paper's figures from our results, and three that it does not have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from nbv.errors import UserError, nearest
from nbv.files import replacing
from nbv.reporting.paper.figures import choice, errors, heatmaps, views
from nbv.reporting.paper.figures.inputs import FigureInputs
from nbv.reporting.style import RC

__all__ = ["FIGURES", "FigureInputs", "FigureKind", "build_figure", "save_figure"]

_DPI = 150


@dataclass(frozen=True)
class FigureKind:
    """One figure: how to draw it, what to print under it, and which stages' files it reads."""

    draw: Callable[[FigureInputs], Figure]
    caption: str
    needs: frozenset[str]


def _kind(draw: Callable[[FigureInputs], Figure], caption: str, needs: str) -> FigureKind:
    return FigureKind(draw, caption, frozenset(needs.split()))


FIGURES: Mapping[str, FigureKind] = {
    "figure2": _kind(
        choice.ambiguity,
        "Figure 2. Ambiguity selects the next viewpoint: an initial view from where the category's "
        "single-view error is largest, the recommended, the opposite and the most ambiguous "
        "(worst) next view, and the ambiguity of each. The object has the median single-view error "
        "of its fold.",
        "evaluation depth lookup splits",
    ),
    "figure3": _kind(
        choice.idea,
        "Figure 3. The idea: how widely the pose is spread given one view's estimate (top), how "
        "widely the paper's Eq. 3 expects it to be spread with a second view, for the recommended "
        "and the worst rotation (middle), and what is left once the second view's estimate is in "
        "(bottom; both estimates combined by Bayes' rule).",
        "evaluation depth lookup splits",
    ),
    "figure5": _kind(
        views.categories,
        "Figure 5. Depth images of each category. Nearer is brighter; white is background.",
        "evaluation depth",
    ),
    "figure6": _kind(
        views.elevations,
        "Figure 6. Depth images at different elevations. Nearer is brighter; white is background.",
        "evaluation depth",
    ),
    "figure7": _kind(
        choice.picks,
        "Figure 7. The next view of each method for the initial image of Figure 2, and the pose "
        "estimated from both.",
        "evaluation depth splits",
    ),
    "figure8": _kind(
        views.groups,
        "Figure 8. The four groups of initial viewpoints of Table 5.",
        "evaluation depth",
    ),
    "figure9": _kind(
        errors.boxplots,
        "Figure 9. Pose errors by category and method. Above as in the paper (minimum, quartiles, "
        "median, maximum); below with whiskers to the 5th and 95th percentile. No point is left "
        "out as an outlier, and none is drawn singly.",
        "evaluation",
    ),
    "pea": _kind(
        errors.accuracy,
        "Pose estimation accuracy: the fraction of images with an error below the threshold. The "
        "pAUC is the area below a curve on a linear axis.",
        "evaluation",
    ),
    "azimuth": _kind(
        errors.by_azimuth,
        "Mean error by initial azimuth, a running mean over 15°. Dotted lines bound the viewpoint "
        "groups.",
        "evaluation",
    ),
    "heatmaps": _kind(
        heatmaps.lookup_maps,
        "One fold's lookup table: the true viewpoint's likelihood given the estimate, and the "
        "ambiguity of each rotation with the recommended one marked. A good estimator's likelihood "
        "lies on the dotted diagonal.",
        "evaluation lookup",
    ),
}
"""Figures by name, in the order of a report."""


def build_figure(name: str, inputs: FigureInputs) -> Figure:
    """Draw one figure.

    Parameters
    ----------
    name : str
        A key of `FIGURES`.
    inputs : FigureInputs
        Results; `FigureKind.needs` says which stages' files are read besides.

    Raises
    ------
    UserError
        If there is no such figure, nothing was evaluated, or a file it needs is missing.
    """
    if name not in FIGURES:
        raise UserError(f"no figure {name!r}; {nearest(name, FIGURES)}")
    if not inputs.evaluations:
        raise UserError(f"{name}: no evaluated category and elevation; run the workflow first")
    with mpl.rc_context(RC):
        return FIGURES[name].draw(inputs)


def save_figure(figure: Figure, stem: str | Path) -> list[Path]:
    """Write ``<stem>.png`` (150 dpi) and ``<stem>.pdf``; the same figure gives the same bytes."""
    stem = Path(stem)
    png, pdf = (stem.with_name(f"{stem.name}{suffix}") for suffix in (".png", ".pdf"))
    with mpl.rc_context(RC):
        with replacing(png) as temporary:
            figure.savefig(temporary, dpi=_DPI, metadata={"Software": None})
        with replacing(pdf) as temporary:
            figure.savefig(temporary, metadata={"CreationDate": None})
    return [png, pdf]

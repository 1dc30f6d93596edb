"""A figure by its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import matplotlib as mpl
from matplotlib.figure import Figure

from nbv.errors import UserError, nearest
from nbv.experiment.report.figures import choice, errors, steps, views
from nbv.experiment.report.figures.inputs import FigureInputs
from nbv.style import RC

_DRAWN_BY: Mapping[str, Callable[[FigureInputs], Figure]] = {
    "steps": steps.steps,
    "figure2": choice.selection,
    "figure3": choice.idea,
    "figure5": views.categories,
    "figure6": views.elevations,
    "figure7": choice.picks,
    "figure8": views.groups,
    "figure9": errors.boxplots,
    "pea": errors.accuracy,
    "azimuth": errors.by_azimuth,
    "heatmaps": views.lookup_maps,
}


def build_figure(name: str, inputs: FigureInputs) -> Figure:
    """Draw one of `nbv.experiment.report.figures.FIGURES` from at least the inputs that it needs.

    Raises
    ------
    UserError
        If the figure is unknown, nothing was evaluated, or a file is missing.
    """
    if name not in _DRAWN_BY:
        raise UserError(f"no figure {name!r}; {nearest(name, _DRAWN_BY)}")
    if not inputs.evaluations:
        raise UserError(f"{name}: no evaluated category and elevation; run the workflow first")
    with mpl.rc_context(RC):
        return _DRAWN_BY[name](inputs)

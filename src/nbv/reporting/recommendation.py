"""A recommendation as a picture: what the network saw, what it believes, and where to look next."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from nbv.bundles.next_view import Recommendation
from nbv.errors import UserError
from nbv.rendering.depth_codes import decode_depth
from nbv.reporting.style import INK, MUTED, RC, method_style, new_figure, save_figure

KINDS = ("png", "pdf", "svg")

_METHOD = method_style("expected_error", ())
_MOST_CROPS = 4


def draw_recommendation(answer: Recommendation, path: str | Path, category: str = "object") -> None:
    """Draw crops, belief and expected errors into one figure.

    Parameters
    ----------
    answer : Recommendation
    path : path
        Its suffix chooses the kind, one of `KINDS`.
    category : str
        For the titles.

    Raises
    ------
    UserError
        For another kind of file.
    """
    path = Path(path)
    kind = path.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise UserError(f"--plot={path}: give a name that ends in .png, .pdf or .svg")
    crops = answer.crops[-_MOST_CROPS:]
    with mpl.rc_context(RC):
        figure = new_figure(2.3 * len(crops) + 6.4, 3.3)
        grid = figure.add_gridspec(1, len(crops) + 2, width_ratios=[1.0] * len(crops) + [1.4, 1.4])
        for place, codes in enumerate(crops):
            axes = figure.add_subplot(grid[place])
            axes.imshow(decode_depth(codes), cmap="viridis", vmin=-0.4, vmax=0.4)
            axes.set(xticks=[], yticks=[], title=_frame_title(place, len(crops)))
            axes.spines[:].set_visible(False)
            axes.grid(visible=False)
        _draw_belief(_polar(figure.add_subplot(grid[-2], projection="polar")), answer, category)
        _draw_errors(_polar(figure.add_subplot(grid[-1], projection="polar")), answer)
    save_figure(figure, {kind: path})


def _frame_title(place: int, n: int) -> str:
    return "What the network sees" if n == 1 else f"Frame {place + 1}"


def _polar(axes: Axes) -> PolarAxes:
    if not isinstance(axes, PolarAxes):
        raise TypeError("not a polar axes")
    axes.set_xticks(np.radians([0, 90, 180, 270]))
    axes.tick_params(axis="y", labelsize=7, labelcolor=MUTED)
    return axes


def _closed(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    angles = 2 * np.pi * np.arange(len(values) + 1) / len(values)
    return angles, np.append(values, values[0])


def _draw_belief(axes: PolarAxes, answer: Recommendation, category: str) -> None:
    # The radius is a square root, so that areas are probabilities.
    angles, radius = _closed(np.sqrt(answer.belief))
    axes.fill(angles, radius, color=INK, alpha=0.2)
    axes.plot(angles, radius, color=INK)
    axes.plot(2 * [math.radians(answer.azimuth_deg)], [0, radius.max()], color=INK, linewidth=1)
    axes.set_yticklabels([])
    axes.set_title(
        f"Azimuth about the {category}: {answer.azimuth_deg:.0f}°\n"
        f"expected error {answer.expected_error_deg:.1f}°"
    )


def _draw_errors(axes: PolarAxes, answer: Recommendation) -> None:
    error = np.where(np.isfinite(answer.error_after_deg), answer.error_after_deg, np.nan)
    axes.plot(*_closed(error), color=INK, linewidth=1.3)
    axes.plot(
        math.radians(answer.move.rotation_deg),
        answer.move.expected_error_deg,
        marker="D",
        color=_METHOD.color,
        markeredgecolor=INK,
        markersize=7,
        linestyle="none",
        label="recommended",
    )
    if answer.alternatives:
        axes.plot(
            np.radians([move.rotation_deg for move in answer.alternatives]),
            [move.expected_error_deg for move in answer.alternatives],
            marker="o",
            markerfacecolor="none",
            color=MUTED,
            linestyle="none",
            label="alternatives",
        )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2, handletextpad=0.1)
    axes.set_ylim(0, 1.05 * float(np.nanmax(error)))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    # Where no curve is: next to the camera's own place.
    axes.set_rlabel_position(0)
    rotation = f"{answer.move.rotation_deg:+g}".replace("-", "−")
    axes.set_title(
        "Expected error (degrees) after a turn\n"
        f"best: {rotation}°, {answer.move.expected_error_deg:.1f}°"
    )

"""Figure of a recommendation: crops, belief, expected errors and the next view."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path as Outline
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from nbv.choice.next_view import Move, Recommendation
from nbv.data.depth_codes import decode_depth
from nbv.errors import UserError
from nbv.style import INK, MUTED, RC, method_style, new_figure, save_figure

KINDS = ("png", "pdf", "svg")

_METHOD = method_style("expected_error", ())
_MOST_CROPS = 4

# Multiples of the largest error, so that the move is drawn outside all curves.
_MOVE_RADIUS, _RIM = 1.14, 1.26


def draw_recommendation(answer: Recommendation, path: str | Path, category: str = "object") -> None:
    """Draw crops, belief, expected errors and the move into one figure.

    It shows at most the last four frames, and no errors and move if there is no next view. The
    suffix selects the format; raise UserError where it is not one of `KINDS`.
    """
    path = Path(path)
    kind = path.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise UserError(f"`path`={path}: give a name that ends in .png, .pdf or .svg")
    crops = answer.crops[-_MOST_CROPS:]
    with mpl.rc_context(RC):
        circles = 1 if answer.move is None else 2
        figure = new_figure(2.3 * len(crops) + 3.2 * circles, 3.3)
        widths = [1.0] * len(crops) + [1.4] * circles
        grid = figure.add_gridspec(1, len(widths), width_ratios=widths)
        for i, codes in enumerate(crops):
            axes = figure.add_subplot(grid[i])
            axes.imshow(decode_depth(codes), cmap="viridis", vmin=-0.4, vmax=0.4)
            axes.set(xticks=[], yticks=[], title=_frame_title(i, len(crops), len(answer.crops)))
            axes.spines[:].set_visible(False)
            axes.grid(visible=False)
        axes = figure.add_subplot(grid[len(crops)], projection="polar")
        _draw_belief(_polar(axes), answer, category)
        if answer.move is not None:
            axes = figure.add_subplot(grid[-1], projection="polar")
            _draw_errors(_polar(axes), answer, answer.move)
    save_figure(figure, {kind: path})


def _frame_title(i: int, n_shown: int, n: int) -> str:
    if n == 1:
        return "Network input"
    number = n - n_shown + i + 1
    return f"Frame {number}" if n == n_shown else f"Frame {number} of {n}"


def _polar(axes: Axes) -> PolarAxes:
    if not isinstance(axes, PolarAxes):
        raise TypeError("not a polar axes")
    axes.set_xticks(np.radians([0, 90, 180, 270]))
    axes.set_yticklabels([])
    return axes


def _closed(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    angles = 2 * np.pi * np.arange(len(values) + 1) / len(values)
    return angles, np.append(values, values[0])


def _draw_belief(axes: PolarAxes, answer: Recommendation, category: str) -> None:
    # The square root makes areas proportional to probabilities.
    angles, radius = _closed(np.sqrt(answer.belief))
    axes.fill(angles, radius, color=INK, alpha=0.2)
    axes.plot(angles, radius, color=INK)
    axes.plot(2 * [math.radians(answer.azimuth_deg)], [0, radius.max()], color=INK, linewidth=1)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_yticklabels([])
    axes.set_xlabel("radius: √p(azimuth)")
    axes.set_title(
        f"Azimuth (camera around {category}): {answer.azimuth_deg:.0f}°\n"
        f"expected error {answer.expected_error_deg:.1f}°"
    )


def _draw_errors(axes: PolarAxes, answer: Recommendation, best: Move) -> None:
    error = np.where(np.isfinite(answer.error_after_deg), answer.error_after_deg, np.nan)
    axes.plot(*_closed(error), color=INK, linewidth=1.3)
    # A line does not show a value without neighbours.
    alone = np.isnan(np.roll(error, 1)) & np.isnan(np.roll(error, -1))
    axes.plot(*_closed(np.where(alone, error, np.nan)), ".", color=INK)
    axes.plot(
        math.radians(best.rotation_deg),
        best.expected_error_deg,
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
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, handletextpad=0.1)
    largest = float(np.nanmax(error))
    _draw_move(axes, best.rotation_deg, _MOVE_RADIUS * largest)
    _label_radii(axes, largest)
    axes.set_xticklabels(["", "+90°", "180°", "−90°"])
    # A tick's label is centred, and one this wide would reach into the circle.
    axes.annotate(
        *("0°: the\ncamera\nnow", (0.0, _RIM * largest), (5, 0)),
        textcoords="offset points",
        va="center",
        fontsize=mpl.rcParams["xtick.labelsize"],
    )
    rotation = f"{best.rotation_deg:+g}".replace("-", "−")
    axes.set_title(
        "Expected error (degrees) after a rotation\n"
        f"recommended: {rotation}°, {best.expected_error_deg:.1f}°"
    )


def _draw_move(axes: PolarAxes, rotation_deg: float, radius: float) -> None:
    """Draw the path of the camera from 0°."""
    angles = np.radians(np.linspace(0.0, rotation_deg, 181))
    axes.add_patch(
        FancyArrowPatch(
            path=Outline(np.column_stack([angles, np.full_like(angles, radius)])),
            arrowstyle="-|>",
            mutation_scale=11,
            shrinkA=0,
            shrinkB=0,
            color=_METHOD.color,
            linewidth=1.8,
            gid="move",
        )
    )
    axes.plot(0, radius, marker="o", color=_METHOD.color, markersize=5)


def _label_radii(axes: PolarAxes, largest: float) -> None:
    """Label the circles of errors along 0°, where there is no curve."""
    ticks = [tick for tick in MaxNLocator(4).tick_values(0.0, largest) if 0 < tick <= largest]
    axes.set_ylim(0, _RIM * largest)
    axes.set_yticks(ticks, [""] * len(ticks))
    for tick in ticks:
        axes.text(
            *(0.0, tick, f"{tick:g}"),
            ha="center",
            va="center",
            fontsize=7,
            color=MUTED,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )

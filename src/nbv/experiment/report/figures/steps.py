"""The method in three steps, on the example: as one figure, and as an animation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from nbv.core.angles import circular_distance_deg, nearest_bin, wrap_deg
from nbv.core.lookup import LookupTable
from nbv.experiment.report.figures.choice import two_view_belief
from nbv.experiment.report.figures.inputs import (
    CostWords,
    ExampleView,
    FigureInputs,
    cost_words,
    example_view,
)
from nbv.experiment.report.figures.views import depth_limits, draw_depth
from nbv.files import replacing
from nbv.robot.style import INK, MUTED, RC, azimuth_axis, mark_azimuth, method_style, new_figure

Curve = NDArray[np.float32]

_DPI = 90
_COLOURS = 48
_TURNING_FRAMES = 32
_LOOKING_FRAMES = 20
_STEP_MS, _READ_MS = 90, 2600


@dataclass(frozen=True)
class _Steps:
    """The example, what the table says of its first estimate, and its estimate from everywhere.

    Rotations are bins of the lookup table; `estimates_deg` holds one estimate for each azimuth
    that the object was evaluated from.
    """

    shown: ExampleView
    lookup: LookupTable
    estimates_deg: dict[int, float]
    words: CostWords
    color: str

    @property
    def n_bins(self) -> int:
        return len(self.lookup.cost)

    @property
    def step_deg(self) -> float:
        return 360 / self.n_bins

    @property
    def first(self) -> int:
        return int(nearest_bin(self.shown.estimate_deg, self.n_bins))

    @property
    def best(self) -> int:
        return round(int(self.lookup.recommended_delta_deg[self.first]) / self.step_deg)

    @property
    def one_view(self) -> Curve:
        return np.asarray(self.lookup.viewpoint_likelihood[self.first])

    def azimuth_deg(self, delta: int) -> float:
        """Return where the camera is after a rotation."""
        return float(wrap_deg(self.shown.azimuth_deg + delta * self.step_deg))

    def two_views(self, delta: int) -> Curve:
        """Return the pose's distribution after a second view at a rotation."""
        azimuths = np.array(list(self.estimates_deg))
        nearest = azimuths[circular_distance_deg(azimuths, self.azimuth_deg(delta)).argmin()]
        second = int(nearest_bin(self.estimates_deg[int(nearest)], self.n_bins))
        return two_view_belief(self.lookup, self.first, second, delta)


def steps(inputs: FigureInputs) -> Figure:
    """Draw one view's distribution, the lookup table's row for it, and two views' distribution."""
    found = _steps(inputs)
    delta = round(found.best * found.step_deg)
    figure = new_figure(3.9, 5.9)
    grid = figure.add_gridspec(3, 2, width_ratios=(1, 2.3))
    limits = depth_limits(found.shown.views)
    after = found.two_views(found.best)
    top = _top([found.one_view, after])
    titles = (
        f"1  One view, estimate {round(found.shown.estimate_deg) % 360}°",
        "2  The table: cost of each turn",
        f"3  Two views, δ = {delta}°",
    )
    for row, (title, turned) in enumerate(zip(titles, (0, None, found.best), strict=True)):
        axes = figure.add_subplot(grid[row, 1])
        axes.set_title(title, loc="left", fontweight="bold", fontsize=9)
        image = figure.add_subplot(grid[row, 0])
        if turned is None:
            _draw_ring(image, found, [0, found.best])
            _draw_cost(axes, found, found.best)
            azimuth_axis(axes, "Rotation δ (degrees)")
            continue
        azimuth = found.azimuth_deg(turned)
        draw_depth(image, found.shown.view(azimuth), limits)
        image.set_xlabel(f"from {azimuth:.0f}°")
        curve = after if turned else found.one_view
        _draw_pose(axes, found, curve, method_style("single", ()).color if not turned else "", top)
        azimuth_axis(axes, "Pose (degrees)")
    return figure


def animation_frames(inputs: FigureInputs) -> Iterator[tuple[Figure, int]]:
    """Yield each frame with its duration in milliseconds.

    One view; the table's row is looked through; the camera turns, and each frame shows what both
    views would say if it stopped there; two views.
    """
    found = _steps(inputs)
    best = found.best if found.best <= found.n_bins / 2 else found.best - found.n_bins
    turned = np.unique(np.linspace(0, best, _TURNING_FRAMES).round().astype(int))
    turned = turned if best >= 0 else turned[::-1]
    looked = np.linspace(0, found.n_bins, _LOOKING_FRAMES, endpoint=False).astype(int)
    top = _top([found.one_view, *(found.two_views(int(delta)) for delta in turned)])
    estimate = round(found.shown.estimate_deg) % 360
    delta = round(found.best * found.step_deg)
    one = f"1  One view, estimate {estimate}°: many poses fit it"
    yield _frame(found, one, 0, None, top), _READ_MS
    look = f"2  The lookup table's row for {estimate}°: what does a turn cost?"
    for place in looked:
        yield _frame(found, look, 0, int(place), top), _STEP_MS
    chosen = f"2  A turn by δ = {delta}° costs least"
    yield _frame(found, chosen, 0, found.best, top), _READ_MS
    turning = "3  The camera turns, the shorter way"
    for place in turned[1:-1]:
        yield _frame(found, turning, int(place), found.best, top), _STEP_MS
    two = f"3  Two views, δ = {delta}°: few poses fit both"
    yield _frame(found, two, best, found.best, top), 2 * _READ_MS


@mpl.rc_context(RC)
def save_animation(inputs: FigureInputs, path: Path) -> None:
    """Write `animation_frames` as a GIF that repeats; the same inputs give the same bytes."""
    images, durations = [], []
    for figure, duration in animation_frames(inputs):
        with BytesIO() as file:
            figure.savefig(file, format="png", dpi=_DPI, metadata={"Software": None})
            images.append(Image.open(file).convert("RGB"))
        durations.append(duration)
    # One palette, so that what does not move does not flicker: of the first and the last frame.
    ends = Image.new("RGB", (images[0].width, 2 * images[0].height))
    ends.paste(images[0], (0, 0))
    ends.paste(images[-1], (0, images[0].height))
    palette = ends.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    shared = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    with replacing(path) as temporary:
        shared[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=shared[1:],
            duration=durations,
            loop=0,
            optimize=False,
        )


def _steps(inputs: FigureInputs) -> _Steps:
    shown = example_view(inputs)
    frame, example = inputs.evaluations[shown.unit], shown.example
    of_object = frame[(frame["object_id"] == example.object_id) & (frame["fold"] == example.fold)]
    each = of_object.drop_duplicates("initial_deg")
    columns = each["initial_deg"].astype(int), each["initial_estimate_deg"].astype(float)
    estimates = dict(zip(*columns, strict=True))
    lookup = inputs.lookup(example.fold)
    color = inputs.style(inputs.settings.subject).color
    return _Steps(shown, lookup, estimates, cost_words(lookup), color)


def _frame(found: _Steps, text: str, delta: int, looked: int | None, top: float) -> Figure:
    """Draw the view after a rotation, and the row of the table up to a place."""
    figure = new_figure(6.4, 4.3)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 2.1))
    image = figure.add_subplot(grid[0, 0])
    azimuth = found.azimuth_deg(delta)
    draw_depth(image, found.shown.view(azimuth), depth_limits(found.shown.views))
    image.set_xlabel(f"depth image from {azimuth:.0f}°")
    pose = figure.add_subplot(grid[0, 1])
    turned = delta != 0
    curve = found.two_views(delta) if turned else found.one_view
    _draw_pose(pose, found, curve, "" if turned else method_style("single", ()).color, top)
    azimuth_axis(pose, "Pose: azimuth of the first view (degrees)")
    _draw_ring(figure.add_subplot(grid[1, 0]), found, [0, delta] if turned else [0])
    cost = figure.add_subplot(grid[1, 1])
    _draw_cost(cost, found, looked)
    azimuth_axis(cost, "Rotation δ to the next view (degrees)")
    figure.suptitle(text, fontsize=11, x=0.02, ha="left", fontweight="bold")
    return figure


def _draw_pose(axes: Axes, found: _Steps, curve: Curve, color: str, top: float) -> None:
    """Draw the pose's distribution; without a colour of its own in that of two views."""
    azimuths = np.arange(found.n_bins) * found.step_deg
    axes.plot(azimuths, curve, color=color or found.color, linewidth=1.8)
    axes.fill_between(azimuths, curve, color=color or found.color, alpha=0.2, linewidth=0)
    mark_azimuth(axes, found.shown.azimuth_deg, "true pose")
    axes.set_ylim(0, top)
    axes.set_ylabel(f"Probability per {found.step_deg:g}°")


def _draw_cost(axes: Axes, found: _Steps, marked: int | None) -> None:
    row = found.lookup.cost[found.first]
    axes.plot(np.arange(found.n_bins) * found.step_deg, row, color=INK, linewidth=1.3)
    if marked is not None:
        place = marked % found.n_bins
        least = place == found.best
        axes.plot(
            place * found.step_deg,
            row[place],
            marker="D" if least else "o",
            color=found.color if least else MUTED,
            markeredgecolor=INK,
            markersize=7,
            clip_on=False,
        )
        if least:
            delta = place * found.step_deg
            mark_azimuth(axes, delta, f"least at {delta:.0f}°")
    low, high = float(row.min()), float(row.max())
    axes.set_ylim(low - 0.1 * (high - low or 1.0), high + 0.3 * (high - low or 1.0))
    axes.set_ylabel(f"{found.words.cost} ({found.words.unit})")


def _draw_ring(axes: Axes, found: _Steps, deltas: Sequence[int]) -> None:
    """Draw the object from above and the camera before and after each rotation."""
    axes.set_axis_off()
    axes.set_aspect("equal")
    around = np.radians(np.arange(361))
    axes.plot(np.cos(around), np.sin(around), color=MUTED, linewidth=0.8)
    axes.plot(0, 0, marker="o", color=MUTED, markersize=14)
    axes.set(xlim=(-1.45, 1.45), ylim=(-1.45, 1.45))
    start = found.shown.azimuth_deg
    for number, delta in enumerate(deltas, 1):
        turn = (delta * found.step_deg + 180) % 360 - 180
        angle = np.radians(start + turn)
        color = method_style("single", ()).color if number == 1 else found.color
        place = np.cos(angle), np.sin(angle)
        axes.plot([0.35 * place[0], place[0]], [0.35 * place[1], place[1]], color=color, lw=0.9)
        axes.plot(*place, marker="o", color=color, markersize=8)
        # Two numbers need this angle between them.
        aside = np.copysign(max(0.0, 25.0 - abs(turn)), turn) if number > 1 else 0.0
        named = angle + np.radians(aside)
        axes.text(1.28 * np.cos(named), 1.28 * np.sin(named), str(number), ha="center", va="center")
        if number > 1:
            arc = np.radians(start + np.linspace(0, turn, 60))
            axes.plot(1.06 * np.cos(arc), 1.06 * np.sin(arc), color=color, linewidth=1.8)


def _top(curves: Sequence[Curve]) -> float:
    return 1.25 * max(float(curve.max()) for curve in curves)

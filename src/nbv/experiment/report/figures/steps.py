"""The method in three steps on the example, as a figure and as an animation."""

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

from nbv.core.circle.angles import circular_distance_deg, nearest_bin, wrap_deg
from nbv.core.circle.lookup import CostTable
from nbv.experiment.report.figures.choice import two_view_belief
from nbv.experiment.report.figures.inputs import (
    CostWords,
    ExampleView,
    FigureInputs,
    cost_words,
    example_view,
)
from nbv.experiment.report.figures.views import depth_limits, draw_depth
from nbv.experiment.report.settings import SUBJECT
from nbv.files import replacing
from nbv.style import INK, MUTED, RC, azimuth_axis, mark_azimuth, method_style, new_figure

Curve = NDArray[np.float32]

_DPI = 90
_COLOURS = 48
_MOVING_FRAMES = 32
_LOOKING_FRAMES = 20
_STEP_MS, _READ_MS = 90, 2600


@dataclass(frozen=True)
class _Scene:
    """The example with its lookup table and its estimates from all azimuths.

    Rotations are bins of the lookup table; `estimates_deg` maps the evaluated azimuths to
    estimates.
    """

    shown: ExampleView
    lookup: CostTable
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
        """Return the azimuth of the camera after a rotation."""
        return float(wrap_deg(self.shown.azimuth_deg + delta * self.step_deg))

    def two_views(self, delta: int) -> Curve:
        """Return the distribution of the pose after a second view at a rotation."""
        azimuths = np.array(list(self.estimates_deg))
        nearest = azimuths[circular_distance_deg(azimuths, self.azimuth_deg(delta)).argmin()]
        second = int(nearest_bin(self.estimates_deg[int(nearest)], self.n_bins))
        return two_view_belief(self.lookup, self.first, second, delta)


def steps(inputs: FigureInputs) -> Figure:
    """Draw one view's distribution, the lookup table's row for it, and two views' distribution."""
    scene = _scene(inputs)
    delta = round(scene.best * scene.step_deg)
    figure = new_figure(3.9, 5.9)
    grid = figure.add_gridspec(3, 2, width_ratios=(1, 2.3))
    limits = depth_limits(scene.shown.views)
    after = scene.two_views(scene.best)
    top = _top([scene.one_view, after])
    titles = (
        f"1  One view, estimate {round(scene.shown.estimate_deg) % 360}°",
        "2  The table: cost by rotation",
        f"3  Two views, δ = {delta}°",
    )
    for row, (title, rotation) in enumerate(zip(titles, (0, None, scene.best), strict=True)):
        axes = figure.add_subplot(grid[row, 1])
        axes.set_title(title, loc="left", fontweight="bold", fontsize=9)
        image = figure.add_subplot(grid[row, 0])
        if rotation is None:
            _draw_ring(image, scene, [0, scene.best])
            _draw_cost(axes, scene, scene.best)
            azimuth_axis(axes, "Rotation δ (degrees)")
            continue
        azimuth = scene.azimuth_deg(rotation)
        draw_depth(image, scene.shown.view(azimuth), limits)
        image.set_xlabel(f"from {azimuth:.0f}°")
        curve = after if rotation else scene.one_view
        _draw_pose(axes, scene, curve, "" if rotation else method_style("single", ()).color, top)
        azimuth_axis(axes, "Pose (degrees)")
    return figure


def animation_frames(inputs: FigureInputs) -> Iterator[tuple[Figure, int]]:
    """Yield each frame with its duration in milliseconds.

    First one view; then the table's row from start to end; then the camera moves, each frame with
    the distribution from both views if it stopped there; last two views.
    """
    scene = _scene(inputs)
    best = scene.best if scene.best <= scene.n_bins / 2 else scene.best - scene.n_bins
    rotations = np.unique(np.linspace(0, best, _MOVING_FRAMES).round().astype(int))
    rotations = rotations if best >= 0 else rotations[::-1]
    looked = np.linspace(0, scene.n_bins, _LOOKING_FRAMES, endpoint=False).astype(int)
    top = _top([scene.one_view, *(scene.two_views(int(delta)) for delta in rotations)])
    estimate = round(scene.shown.estimate_deg) % 360
    delta = round(scene.best * scene.step_deg)
    start = f"1  One view, estimate {estimate}°: many poses fit it"
    yield _frame(scene, start, 0, None, top), _READ_MS
    look = f"2  The lookup table's row for {estimate}°: what does a turn cost?"
    for delta_bin in looked:
        yield _frame(scene, look, 0, int(delta_bin), top), _STEP_MS
    chosen = f"2  A turn by δ = {delta}° costs least"
    yield _frame(scene, chosen, 0, scene.best, top), _READ_MS
    moving = "3  The camera turns, the shorter way"
    for delta_bin in rotations[1:-1]:
        yield _frame(scene, moving, int(delta_bin), scene.best, top), _STEP_MS
    end = f"3  Two views, δ = {delta}°: few poses fit both"
    yield _frame(scene, end, best, scene.best, top), 2 * _READ_MS


@mpl.rc_context(RC)
def save_animation(inputs: FigureInputs, path: Path) -> None:
    """Write `animation_frames` as a GIF that repeats; the same inputs give the same bytes."""
    images, durations = [], []
    for figure, duration in animation_frames(inputs):
        with BytesIO() as file:
            figure.savefig(file, format="png", dpi=_DPI, metadata={"Software": None})
            images.append(Image.open(file).convert("RGB"))
        durations.append(duration)
    # One palette, of the first and the last frame, so that static parts do not flicker.
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


def _scene(inputs: FigureInputs) -> _Scene:
    shown = example_view(inputs)
    frame, example = inputs.evaluations[shown.unit], shown.example
    rows = frame[(frame["object_id"] == example.object_id) & (frame["fold"] == example.fold)]
    each = rows.drop_duplicates("initial_deg")
    columns = each["initial_deg"].astype(int), each["initial_estimate_deg"].astype(float)
    estimates = dict(zip(*columns, strict=True))
    lookup = inputs.lookup(example.fold)
    color = inputs.style(SUBJECT).color
    return _Scene(shown, lookup, estimates, cost_words(lookup), color)


def _frame(scene: _Scene, text: str, delta: int, looked: int | None, top: float) -> Figure:
    """Draw the view after a rotation, and the row of the table with a marked rotation."""
    figure = new_figure(6.4, 4.3)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 2.1))
    image = figure.add_subplot(grid[0, 0])
    azimuth = scene.azimuth_deg(delta)
    draw_depth(image, scene.shown.view(azimuth), depth_limits(scene.shown.views))
    image.set_xlabel(f"depth image from {azimuth:.0f}°")
    pose = figure.add_subplot(grid[0, 1])
    has_moved = delta != 0
    curve = scene.two_views(delta) if has_moved else scene.one_view
    _draw_pose(pose, scene, curve, "" if has_moved else method_style("single", ()).color, top)
    azimuth_axis(pose, "Pose: azimuth of the first view (degrees)")
    _draw_ring(figure.add_subplot(grid[1, 0]), scene, [0, delta] if has_moved else [0])
    cost = figure.add_subplot(grid[1, 1])
    _draw_cost(cost, scene, looked)
    azimuth_axis(cost, "Rotation δ to the next view (degrees)")
    figure.suptitle(text, fontsize=11, x=0.02, ha="left", fontweight="bold")
    return figure


def _draw_pose(axes: Axes, scene: _Scene, curve: Curve, color: str, top: float) -> None:
    """Draw the distribution of the pose, by default in the colour of two views."""
    azimuths = np.arange(scene.n_bins) * scene.step_deg
    axes.plot(azimuths, curve, color=color or scene.color, linewidth=1.8)
    axes.fill_between(azimuths, curve, color=color or scene.color, alpha=0.2, linewidth=0)
    mark_azimuth(axes, scene.shown.azimuth_deg, "true pose")
    axes.set_ylim(0, top)
    axes.set_ylabel(f"Probability per {scene.step_deg:g}°")


def _draw_cost(axes: Axes, scene: _Scene, marked: int | None) -> None:
    row = scene.lookup.cost[scene.first]
    axes.plot(np.arange(scene.n_bins) * scene.step_deg, row, color=INK, linewidth=1.3)
    if marked is not None:
        index = marked % scene.n_bins
        least = index == scene.best
        axes.plot(
            index * scene.step_deg,
            row[index],
            marker="D" if least else "o",
            color=scene.color if least else MUTED,
            markeredgecolor=INK,
            markersize=7,
            clip_on=False,
        )
        if least:
            delta = index * scene.step_deg
            mark_azimuth(axes, delta, f"least at {delta:.0f}°")
    low, high = float(row.min()), float(row.max())
    axes.set_ylim(low - 0.1 * (high - low or 1.0), high + 0.3 * (high - low or 1.0))
    axes.set_ylabel(f"{scene.words.cost} ({scene.words.unit})")


def _draw_ring(axes: Axes, scene: _Scene, deltas: Sequence[int]) -> None:
    """Draw the object from above and the camera before and after each rotation."""
    axes.set_axis_off()
    axes.set_aspect("equal")
    around = np.radians(np.arange(361))
    axes.plot(np.cos(around), np.sin(around), color=MUTED, linewidth=0.8)
    axes.plot(0, 0, marker="o", color=MUTED, markersize=14)
    axes.set(xlim=(-1.45, 1.45), ylim=(-1.45, 1.45))
    start = scene.shown.azimuth_deg
    for number, delta in enumerate(deltas, 1):
        rotation_deg = (delta * scene.step_deg + 180) % 360 - 180
        angle = np.radians(start + rotation_deg)
        color = method_style("single", ()).color if number == 1 else scene.color
        position = np.cos(angle), np.sin(angle)
        axes.plot(
            [0.35 * position[0], position[0]],
            [0.35 * position[1], position[1]],
            color=color,
            lw=0.9,
        )
        axes.plot(*position, marker="o", color=color, markersize=8)
        # The least angle between two numbers.
        aside = np.copysign(max(0.0, 25.0 - abs(rotation_deg)), rotation_deg) if number > 1 else 0.0
        named = angle + np.radians(aside)
        axes.text(1.28 * np.cos(named), 1.28 * np.sin(named), str(number), ha="center", va="center")
        if number > 1:
            arc = np.radians(start + np.linspace(0, rotation_deg, 60))
            axes.plot(1.06 * np.cos(arc), 1.06 * np.sin(arc), color=color, linewidth=1.8)


def _top(curves: Sequence[Curve]) -> float:
    return 1.25 * max(float(curve.max()) for curve in curves)

"""Figures of the selection of the next viewpoint: costs (2), the idea (3), all methods (7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from nbv.core.circle.angles import nearest_bin, wrap_deg
from nbv.core.circle.criteria import SPREADS, pose_likelihood, two_view_poses
from nbv.core.circle.density import Conditionals
from nbv.core.circle.lookup import CostTable
from nbv.experiment.report.figures.inputs import (
    ExampleView,
    FigureInputs,
    cost_words,
    example_view,
)
from nbv.experiment.report.figures.views import depth_limits, draw_depth
from nbv.experiment.report.settings import SUBJECT
from nbv.labels import method_label
from nbv.style import INK, MUTED, azimuth_axis, mark_azimuth, method_style, new_figure

Likelihood = NDArray[np.float32]


def selection(inputs: FigureInputs) -> Figure:
    """Fig. 2: an initial view of the hidden range, three next views, and their costs."""
    shown = example_view(inputs)
    lookup = inputs.lookup(shown.example.fold)
    n_bins = len(lookup.cost)
    first = int(nearest_bin(shown.estimate_deg, n_bins))
    row = lookup.cost[first].astype(np.float64)
    step = 360 / n_bins
    best = round(int(lookup.recommended_delta_deg[first]) / step)
    worst = int(np.argmax(row))
    words = cost_words(lookup)
    candidates = [(best, "recommended"), (round(180 / step), "opposite"), (worst, "worst")]
    figure = new_figure(8.0, 4.2)
    grid = figure.add_gridspec(2, 4, width_ratios=(1.15, 1, 1, 1), height_ratios=(1.0, 0.95))
    limits = depth_limits(shown.views)
    title = f"Initial view, φ = {shown.azimuth_deg}°\nestimate {round(shown.estimate_deg) % 360}°"
    draw_depth(figure.add_subplot(grid[0, 0]), shown.view(shown.azimuth_deg), limits, title)
    for column, (delta_bin, name) in enumerate(candidates, 1):
        azimuth = float(wrap_deg(shown.azimuth_deg + delta_bin * step))
        axes = figure.add_subplot(grid[0, column])
        title = f"{name}: δ = {delta_bin * step:.0f}°\nview at {azimuth:.0f}°"
        draw_depth(axes, shown.view(azimuth), limits, title)
    bars = figure.add_subplot(grid[1, 1:])
    values = [row[delta_bin] for delta_bin, _ in candidates]
    styles = [method_style(method, ()) for method in ("proposed", "opposite")]
    colors = [*(style.color for style in styles), "#bdbdbd"]
    drawn = bars.bar(
        range(3),
        values,
        width=0.42,
        color=colors,
        edgecolor=INK,
        linewidth=0.8,
        hatch=[*(style.hatch for style in styles), "////"],
    )
    bars.bar_label(drawn, fmt="%.3f", padding=2)
    bars.set_xticks(range(3), [name for _, name in candidates])
    bars.set_xlim(-0.6, 2.6)
    bars.set_ylabel(f"{words.cost} A[e, δ] ({words.unit})")
    bars.grid(visible=False, axis="x")
    curve = figure.add_subplot(grid[1, 0])
    curve.plot(np.arange(row.size) * step, row, color=INK, linewidth=1.3)
    for (delta_bin, _), color in zip(candidates, colors, strict=True):
        curve.plot(
            delta_bin * step,
            row[delta_bin],
            "o",
            color=color,
            markeredgecolor=INK,
            markersize=7,
            clip_on=False,
        )
    curve.margins(y=0.2)
    # From 0, the bars of costs that differ by a hundredth would look the same.
    bars.set_ylim(curve.get_ylim())
    azimuth_axis(curve, "Rotation δ (degrees)")
    curve.set_ylabel(f"A[e, δ] ({words.unit})")
    figure.suptitle(f"{words.selects} selects the next view: {shown.title}", fontsize=10)
    return figure


def idea(inputs: FigureInputs) -> Figure:
    """Fig. 3: the spread of the pose after one view, before a second view, and after it."""
    shown = example_view(inputs)
    lookup = inputs.lookup(shown.example.fold)
    viewpoint, estimates = lookup.viewpoint_likelihood, lookup.estimate_likelihood
    n_bins = len(viewpoint)
    step = 360 / n_bins
    first = int(nearest_bin(shown.estimate_deg, n_bins))
    best = round(int(lookup.recommended_delta_deg[first]) / step)
    worst = int(np.argmax(lookup.cost[first]))
    pair = Conditionals(viewpoint.astype(np.float64), estimates.astype(np.float64))
    given = pose_likelihood(pair, lookup.pose_likelihood)
    one_view_color = method_style("single", ()).color
    two_view_color = inputs.style(SUBJECT).color
    curves: list[list[tuple[Likelihood, str, str, str]]] = [
        [(viewpoint[first], "p(φ | e)", one_view_color, "solid")],
        [
            (two_view_poses(viewpoint, given, best)[first], "recommended", two_view_color, "solid"),
            (two_view_poses(viewpoint, given, worst)[first], "worst", MUTED, "dashed"),
        ],
    ]
    titles = ["After one view", "Before a second view: p(θ | e, δ)"]
    rotations = [0, worst, best]
    captions = ["first view", "worst second", "recommended"]
    seen = shown.outcomes.get(SUBJECT)
    if seen is not None and np.isfinite(_delta(shown, SUBJECT)):
        delta = round(float(seen["delta_deg"]) / step)
        second = int(nearest_bin(float(seen["next_estimate_deg"]), n_bins))
        belief = two_view_belief(lookup, first, second, delta)
        curves.append([(belief, "p(θ | e₁, e₂, δ)", two_view_color, "solid")])
        titles.append(f"After the second view at δ = {delta * step:.0f}°")
    figure = new_figure(7.6, 2.1 * len(curves) + 0.4)
    grid = figure.add_gridspec(len(curves), 2, width_ratios=(1, 2.9))
    limits = depth_limits(shown.views)
    unit = " nats" if lookup.spread == "entropy" else ""
    top = 1.3 * max(float(spread.max()) for row in curves for spread, *_ in row)
    azimuths = np.arange(n_bins) * step
    for row, lines in enumerate(curves):
        azimuth = float(wrap_deg(shown.azimuth_deg + rotations[row] * step))
        image = figure.add_subplot(grid[row, 0])
        draw_depth(image, shown.view(azimuth), limits)
        image.set_xlabel(f"{captions[row]}, {azimuth:.0f}°")
        axes = figure.add_subplot(grid[row, 1])
        for line, (spread, name, color, dashes) in enumerate(lines):
            width = float(SPREADS[lookup.spread](spread[np.newaxis])[0])
            label = f"{name}, {width:.2f}{unit}"
            axes.plot(azimuths, spread, color=color, linewidth=1.8, linestyle=dashes, label=label)
            _label_curve(axes, label, line, color, dashes)
        axes.fill_between(azimuths, lines[0][0], color=lines[0][2], alpha=0.2, linewidth=0)
        mark_azimuth(axes, shown.azimuth_deg, "true pose")
        axes.set_ylim(0, top)
        axes.set_title(titles[row])
        axes.set_ylabel(f"Probability per {step:g}°")
        last = row == len(curves) - 1
        azimuth_axis(axes, "Pose: azimuth of the first view (degrees)" if last else "")
    figure.suptitle(f"One viewpoint and two: {shown.title}", fontsize=10)
    return figure


def two_view_belief(lookup: CostTable, first: int, second: int, delta: int) -> Likelihood:
    """Return p(θ | e₁, e₂, δ) by bin, estimates and rotation in bins combined by Bayes' rule."""
    first_belief, estimates = lookup.viewpoint_likelihood[first], lookup.estimate_likelihood
    belief = first_belief * np.roll(estimates[:, second], -delta)
    # Two estimates that exclude each other carry no information.
    belief = belief if belief.any() else np.ones_like(first_belief)
    return np.asarray(belief / belief.sum())


def _label_curve(axes: Axes, label: str, line: int, color: str, dashes: str) -> None:
    """Write the label of a curve at the right, with a sample of its line."""
    height = 0.9 - 0.13 * line
    in_axes: Any = {"transform": axes.transAxes}
    axes.plot([0.62, 0.67], [height] * 2, color=color, linestyle=dashes, linewidth=1.8, **in_axes)
    axes.text(0.685, height, label, va="center", fontsize=8, **in_axes)


def picks(inputs: FigureInputs) -> Figure:
    """Fig. 7: the next view of each method for one initial image, and the resulting error."""
    shown = example_view(inputs)
    methods = [m for m, row in shown.outcomes.items() if np.isfinite(_delta(shown, m))]
    single = [m for m in shown.outcomes if m not in methods]
    figure = new_figure(1.95 * (len(methods) + 1) + 0.3, 2.9)
    axes = figure.subplots(1, len(methods) + 1, squeeze=False)[0]
    limits = depth_limits(shown.views)
    caption = f"φ = {shown.azimuth_deg}°"
    for method in single:
        caption += f"; {method_label(method)}:\n{_result(shown, method)}"
    draw_depth(axes[0], shown.view(shown.azimuth_deg), limits, "Initial view")
    axes[0].set_xlabel(caption)
    for panel, method in zip(axes[1:], methods, strict=True):
        delta = _delta(shown, method)
        azimuth = float(wrap_deg(shown.azimuth_deg + delta))
        draw_depth(panel, shown.view(azimuth), limits, method_label(method))
        panel.set_xlabel(f"δ = {delta:.0f}°, view at {azimuth:.0f}°\n{_result(shown, method)}")
        for spine in panel.spines.values():
            spine.set_color(inputs.style(method).color)
            spine.set_linewidth(2.0)
    figure.suptitle(f"Next views for one image: {shown.title}", fontsize=10)
    return figure


def _delta(shown: ExampleView, method: str) -> float:
    return float(shown.outcomes[method]["delta_deg"])


def _result(shown: ExampleView, method: str) -> str:
    row = shown.outcomes[method]
    return f"pose {row['pose_estimate_deg']:.1f}°, error {row['error_deg']:.1f}°"

"""Figures of errors: boxplots (Fig. 9), accuracy by threshold, error by initial azimuth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from nbv.experiment.report.figures.inputs import FigureInputs
from nbv.experiment.report.settings import common_elevation_deg, reference_units, unit_label
from nbv.experiment.results import Unit
from nbv.experiment.statistics import metrics
from nbv.experiment.statistics.metrics import PAUC_LIMIT_DEG
from nbv.experiment.statistics.paired import PairedErrors, pair_methods
from nbv.labels import method_label
from nbv.style import INK, MUTED, azimuth_axis, new_figure, panel_grid

_WINDOW_DEG = 15
_PANEL_IN = (2.9, 2.6)


def boxplots(inputs: FigureInputs) -> Figure:
    """Fig. 9: minimum, quartiles, median and maximum, and the same without the upper tail."""
    units = reference_units(inputs.evaluations)
    common = common_elevation_deg(units)
    methods = inputs.methods(units[0])
    figure = new_figure(max(1.5 * len(units) + 1.2, 6.0), 6.4)
    whole, close = figure.subplots(2, 1)
    errors = {unit: _paired(inputs, unit).errors_deg for unit in units}
    offsets = (np.arange(len(methods)) - (len(methods) - 1) / 2) * 0.8 / len(methods)
    positions = np.add.outer(np.arange(len(units)), offsets).ravel()
    for axes, whiskers in ((whole, (0, 100)), (close, (5, 95))):
        for offset, method in zip(offsets, methods, strict=True):
            style = inputs.style(method)
            boxes = axes.boxplot(
                [errors[unit][method] for unit in units],
                positions=np.arange(len(units)) + offset,
                widths=0.62 / len(methods),
                whis=whiskers,
                showfliers=False,
                showmeans=True,
                patch_artist=True,
                manage_ticks=False,
                medianprops={"color": "white" if method == "single" else INK, "linewidth": 1.8},
                meanprops={
                    "marker": "D",
                    "markersize": 4,
                    "markerfacecolor": "white",
                    "markeredgecolor": INK,
                },
                whiskerprops={"color": INK, "linewidth": 0.9},
                capprops={"color": INK, "linewidth": 0.9},
            )
            for box in boxes["boxes"]:
                box.set(facecolor=style.color, edgecolor=INK, hatch=style.hatch, linewidth=0.8)
        axes.set_xticks(np.arange(len(units)), [unit_label(unit, common) for unit in units])
        axes.set_ylabel("Pose error (degrees)")
        axes.set_ylim(bottom=0)
        axes.grid(visible=False, axis="x")
    whole.set_title("Whiskers to minimum and maximum, as in the paper")
    whole.set_ylim(0, 185)
    whole.set_yticks([0, 45, 90, 135, 180])
    close.set_title("Close-up: whiskers to the 5th and 95th percentile, cut off where longer")
    close.set_ylim(0, max(_close_limit_deg(e) for unit in units for e in errors[unit].values()))
    close.set_xticks(positions, [method_label(m) for m in methods] * len(units), minor=True)
    close.tick_params(axis="x", which="minor", length=0, labelsize=8, labelrotation=90)
    close.tick_params(axis="x", which="major", length=0, pad=52)
    figure.suptitle(
        f"Errors at elevation {common}° (box: quartiles, line: median, diamond: mean)", fontsize=10
    )
    return figure


def _close_limit_deg(errors_deg: NDArray[np.float64]) -> float:
    """Return the upper limit of the close-up for a method's box, mean and near tail."""
    lower, upper = np.quantile(errors_deg, [0.25, 0.75])
    return float(max(1.1 * np.mean(errors_deg), upper + 1.5 * (upper - lower)))


def accuracy(inputs: FigureInputs) -> Figure:
    """PEA by threshold, up to the 100 degrees that the pAUC integrates over (Eq. 10)."""
    units = reference_units(inputs.evaluations)
    common = common_elevation_deg(units)
    grid = panel_grid(len(units), *_PANEL_IN)
    thresholds = np.linspace(0.0, np.sqrt(PAUC_LIMIT_DEG), 401) ** 2
    for axes, unit in zip(grid.panels, units, strict=True):
        sample = _paired(inputs, unit)
        for method in inputs.methods(unit):
            accuracies = metrics.pea(sample.errors_deg[method], thresholds)
            axes.plot(thresholds, accuracies, **inputs.style(method).curve)
        # Equal steps of the square root spread out the small thresholds, where methods differ.
        axes.set_xscale("function", functions=(np.sqrt, np.square))
        axes.set_xlim(0, PAUC_LIMIT_DEG)
        axes.set_xticks([0, 5, 10, 20, 40, 60, 100])
        axes.set_ylim(0, 1.01)
        axes.set_title(unit_label(unit, common))
        axes.set_xlabel("Threshold τ (degrees, root scale)")
        axes.set_ylabel("PEA(τ) (fraction)")
    grid.add_key(_key(inputs, units))
    grid.figure.suptitle(f"Pose estimation accuracy at elevation {common}°", fontsize=10)
    return grid.figure


def by_azimuth(inputs: FigureInputs) -> Figure:
    """Mean error by initial azimuth, smoothed over 15 degrees."""
    units = reference_units(inputs.evaluations)
    common = common_elevation_deg(units)
    grid = panel_grid(len(units), *_PANEL_IN)
    for axes, unit in zip(grid.panels, units, strict=True):
        sample = _paired(inputs, unit)
        for position, method in enumerate(inputs.methods(unit)):
            axes.plot(
                *_mean_by_azimuth(sample, method),
                **inputs.style(method).curve,
                marker=inputs.style(method).marker,
                markersize=4,
                markevery=(position * 11, 45),
            )
        for boundary in (45, 135, 225, 315):
            axes.axvline(boundary, color=MUTED, linewidth=0.7, linestyle=":")
        axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
        for group, centre in ((1, 22), (2, 90), (3, 180), (4, 270), (1, 338)):
            style: Any = {"ha": "center", "va": "top", "transform": axes.get_xaxis_transform()}
            axes.text(centre, 0.99, str(group), fontsize=8, color=MUTED, **style)
        axes.grid(visible=False, axis="x")
        axes.set_title(unit_label(unit, common))
        axes.set_ylabel("Mean error (degrees)")
        azimuth_axis(axes, "Initial azimuth (degrees)")
    grid.add_key(_key(inputs, units, markers=True))
    grid.figure.suptitle(
        f"Error by initial azimuth at elevation {common}° (viewpoint groups 1–4 above)",
        fontsize=10,
    )
    return grid.figure


def _mean_by_azimuth(
    sample: PairedErrors, method: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    azimuths, index = np.unique(sample.initial_deg, return_inverse=True)
    means = np.bincount(index, weights=sample.errors_deg[method]) / np.bincount(index)
    half = round(_WINDOW_DEG * azimuths.size / 360) // 2
    return azimuths, np.mean([np.roll(means, shift) for shift in range(-half, half + 1)], axis=0)


def _paired(inputs: FigureInputs, unit: Unit) -> PairedErrors:
    return pair_methods(inputs.evaluations[unit], unit[0])


def _key(inputs: FigureInputs, units: Sequence[Unit], markers: bool = False) -> list[Line2D]:
    styles = {method: inputs.style(method) for method in inputs.methods(units[0])}
    return [
        Line2D(
            [],
            [],
            **style.curve,
            marker=style.marker if markers else "",
            markersize=4,
            label=method_label(method),
        )
        for method, style in styles.items()
    ]

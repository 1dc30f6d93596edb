"""Figures of depth images (Figs. 5, 6, 8), and lookup tables as heat maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from nbv.data.depth_images import Codes
from nbv.experiment.report.figures.inputs import FigureInputs, cost_words
from nbv.experiment.report.settings import (
    common_elevation_deg,
    example_fold,
    reference_units,
    unit_label,
)
from nbv.experiment.statistics.paired import VIEWPOINT_GROUPS
from nbv.style import INK, MUTED, SHADE, azimuth_axis, new_figure

_FAR_GREY, _NEAR_GREY = 0.12, 0.86
_BACKGROUND = 0


def depth_limits(images: Codes) -> tuple[int, int]:
    """Return the farthest and nearest code of images, for a common grey scale."""
    seen = images[images != _BACKGROUND]
    return (int(seen.min()), int(seen.max())) if seen.size else (1, 255)


def shade(codes: Codes, limits: tuple[int, int]) -> NDArray[np.float64]:
    """Return grey levels in [0, 1]: far dark, near light, background white.

    The nearest grey is darker than white, so that the outline is visible.
    """
    low, high = limits
    nearness = (codes.astype(np.float64) - low) / max(high - low, 1)
    grey = _FAR_GREY + (_NEAR_GREY - _FAR_GREY) * np.clip(nearness, 0.0, 1.0)
    return np.where(codes == _BACKGROUND, 1.0, grey)


def draw_depth(axes: Axes, codes: Codes, limits: tuple[int, int], title: str = "") -> None:
    """Fill the axes with one image in a thin frame."""
    axes.imshow(shade(codes, limits), cmap="gray", vmin=0.0, vmax=1.0, interpolation="none")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(MUTED)
        spine.set_linewidth(0.6)
    if title:
        axes.set_title(title)


_AZIMUTHS_DEG = tuple(range(0, 360, 45))
_CELL_IN = 1.05
_RING_HEIGHT = 6.4 / 6.8


def categories(inputs: FigureInputs) -> Figure:
    """Fig. 5: the first object of each category from eight azimuths."""
    units = reference_units(inputs.evaluations)
    common = common_elevation_deg(units)
    labels = [unit_label(unit, common) for unit in units]
    title = f"First object of each category, elevation {common}°, by azimuth"
    return _view_rows(inputs, units, labels, title)


def elevations(inputs: FigureInputs) -> Figure:
    """Fig. 6: the first object of the focus category at each elevation."""
    category = inputs.focus[0]
    units = sorted(unit for unit in inputs.evaluations if unit[0] == category)
    labels = [f"{elevation}°" for _, elevation in units]
    title = f"First {category} by elevation (rows) and azimuth (columns)"
    return _view_rows(inputs, units, labels, title)


def _view_rows(
    inputs: FigureInputs, units: list[tuple[str, int]], labels: list[str], title: str
) -> Figure:
    columns = len(_AZIMUTHS_DEG)
    figure = new_figure(columns * _CELL_IN + 0.7, len(units) * _CELL_IN + 0.6)
    grid = figure.subplots(len(units), columns, squeeze=False)
    for row, (unit, label) in enumerate(zip(units, labels, strict=True)):
        views = inputs.views(unit)
        shown = [views[azimuth * views.shape[0] // 360] for azimuth in _AZIMUTHS_DEG]
        limits = depth_limits(np.stack(shown))
        for column, (azimuth, codes) in enumerate(zip(_AZIMUTHS_DEG, shown, strict=True)):
            draw_depth(grid[row, column], codes, limits, f"{azimuth}°" if row == 0 else "")
        grid[row, 0].set_ylabel(label)
    figure.suptitle(title, fontsize=10)
    return figure


def groups(inputs: FigureInputs) -> Figure:
    """Fig. 8: the four groups of initial viewpoints, seen from above, with the views in them."""
    unit = inputs.focus
    figure = new_figure(6.4, 6.8)
    figure.set_layout_engine("none")
    ring = figure.add_axes((0.0, 0.0, 1.0, _RING_HEIGHT))
    ring.set_xlim(-1, 1)
    ring.set_ylim(-1, 1)
    ring.set_axis_off()
    views = inputs.views(unit)
    limits = depth_limits(views[:: max(views.shape[0] // 24, 1)])
    shades = ("#ffffff", SHADE, "#ffffff", SHADE)
    for shade_color, (group, (start, stop)) in zip(shades, VIEWPOINT_GROUPS.items(), strict=True):
        span = np.radians(np.linspace(start, start + (stop - start) % 360, 60))
        outline = 0.98 * np.stack([np.cos(span), np.sin(span)])
        ring.fill([0, *outline[0]], [0, *outline[1]], facecolor=shade_color, edgecolor=MUTED)
        middle = np.radians(start + ((stop - start) % 360) / 2)
        text = f"Group {group}\n" + (
            f"{start}°–359°\n0°–{stop - 1}°" if start > stop else f"{start}°–{stop - 1}°"
        )
        ring.text(
            0.30 * np.cos(middle), 0.30 * np.sin(middle), text, ha="center", va="center", color=INK
        )
    size = 0.13
    for azimuth in range(0, 360, 30):
        angle = np.radians(azimuth)
        centre = 0.5 + 0.39 * np.array([np.cos(angle), np.sin(angle)])
        bottom = (centre[1] - size / 2 - 0.008) * _RING_HEIGHT
        image = figure.add_axes((centre[0] - size / 2, bottom, size, size * _RING_HEIGHT))
        draw_depth(image, views[azimuth * views.shape[0] // 360], limits)
        image.set_title(f"{azimuth}°", fontsize=8, pad=2)
    figure.suptitle(
        f"First {unit[0]} at elevation {unit[1]}°, camera azimuth seen from above",
        fontsize=10,
        y=0.985,
    )
    return figure


_DECADES = 3.0


def lookup_maps(inputs: FigureInputs) -> Figure:
    """Draw V[estimate, viewpoint] and A[estimate, δ], with the recommended δ by estimate."""
    unit = inputs.focus
    fold = example_fold(inputs.evaluations[unit])
    lookup = inputs.lookup(fold)
    words = cost_words(lookup)
    likelihood = np.asarray(lookup.viewpoint_likelihood, dtype=np.float64)
    cost = np.asarray(lookup.cost, dtype=np.float64)
    figure = new_figure(8.6, 4.1)
    left, right = figure.subplots(1, 2)
    half = 180 / likelihood.shape[0]
    extent = (-half, 360 - half, -half, 360 - half)
    top = likelihood.max()
    image: Any = {"origin": "lower", "extent": extent, "cmap": "cividis"}
    image |= {"interpolation": "none", "aspect": "auto"}
    shown = left.imshow(likelihood.T, norm=LogNorm(top / 10**_DECADES, top), **image)
    left.plot([0, 360], [0, 360], color="black", linewidth=1.0, linestyle=":")
    left.set_title("Viewpoint likelihood V[e, φ]")
    azimuth_axis(left, "True viewpoint φ (degrees)", vertical=True)
    figure.colorbar(shown, ax=left, label="Probability per bin (log scale)", extend="min")
    shown = right.imshow(cost.T, **image)
    n_bins = cost.shape[0]
    right.plot(
        np.arange(n_bins) * 360 / n_bins,
        lookup.recommended_delta_deg,
        linestyle="",
        marker="o",
        markersize=2.2,
        color="white",
        markeredgecolor="black",
        markeredgewidth=0.3,
    )
    right.set_title(f"{words.table} A[e, δ], dots: recommended")
    azimuth_axis(right, "Rotation δ (degrees)", vertical=True)
    figure.colorbar(shown, ax=right, label=f"{words.cost} ({words.unit}); lower is better")
    for axes in (left, right):
        azimuth_axis(axes, "Estimate e (degrees)")
        axes.grid(visible=False)
    figure.suptitle(f"Lookup table of {unit[0]}, elevation {unit[1]}°, fold {fold}", fontsize=10)
    return figure

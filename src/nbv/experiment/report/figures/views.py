"""What the estimator sees: examples by category (Fig. 5), elevation (6) and group (8)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from nbv.experiment.report.figures.depth import depth_limits, draw_depth
from nbv.experiment.report.figures.inputs import FigureInputs
from nbv.experiment.report.settings import common_elevation_deg, reference_units, unit_label
from nbv.experiment.statistics.paired import VIEWPOINT_GROUPS
from nbv.robot.style import INK, MUTED, SHADE, new_figure

_AZIMUTHS_DEG = tuple(range(0, 360, 45))
_CELL_IN = 1.05
_RING_HEIGHT = 6.4 / 6.8


def categories(inputs: FigureInputs) -> Figure:
    """Fig. 5: the first object of each category from eight azimuths."""
    units = reference_units(inputs.evaluations, inputs.settings)
    common = common_elevation_deg(units, inputs.settings)
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

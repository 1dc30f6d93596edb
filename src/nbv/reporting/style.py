"""One style for every figure: colours for the colour-blind, marks that survive grey print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.typing import LineStyleType

from nbv.files import replacing

RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "hatch.linewidth": 0.7,
    "pdf.fonttype": 42,
    "svg.hashsalt": "nbv",
}
"""Matplotlib settings in force while a figure is built and saved."""

_SAVED: Mapping[str, Mapping[str, Any]] = {
    "png": {"dpi": 150, "metadata": {"Software": None}},
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
}

INK = "#222222"
MUTED = "#666666"


@dataclass(frozen=True)
class MethodStyle:
    """One method's colour, line, marker and hatch, the same in every figure."""

    color: str
    line: LineStyleType
    marker: str
    hatch: str
    width: float = 1.5

    @property
    def curve(self) -> dict[str, Any]:
        """How the method's curves are drawn, without markers."""
        return {"color": self.color, "linestyle": self.line, "linewidth": self.width}


_STYLES: Mapping[str, MethodStyle] = {
    "single": MethodStyle("#000000", (0, (1.0, 1.2)), "o", ""),
    "random": MethodStyle("#E69F00", (0, (5.0, 2.0)), "s", "////"),
    "opposite": MethodStyle("#0072B2", (0, (6.0, 1.5, 1.0, 1.5)), "^", "...."),
    "proposed": MethodStyle("#D55E00", "solid", "D", "", 2.2),
}
_FURTHER = (
    MethodStyle("#009E73", (0, (3.0, 1.0)), "v", "xxxx"),
    MethodStyle("#CC79A7", (0, (8.0, 2.0)), "P", "\\\\\\\\"),
    MethodStyle("#56B4E9", (0, (4.0, 1.0, 1.0, 1.0, 1.0, 1.0)), "X", "++++"),
    MethodStyle("#8C6D00", (0, (2.0, 2.0)), "<", "oo"),
)


def method_style(method: str, methods: tuple[str, ...]) -> MethodStyle:
    """Return a method's style; extensions take the next ones in turn."""
    if method in _STYLES:
        return _STYLES[method]
    others = [name for name in methods if name not in _STYLES]
    return _FURTHER[others.index(method) % len(_FURTHER)]


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that draws itself without a display or any global state."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def azimuth_axis(axes: Axes, label: str, vertical: bool = False) -> None:
    """Mark a circle of degrees every 90."""
    ticks = [0, 90, 180, 270, 360]
    if vertical:
        axes.set(ylim=(0, 360), yticks=ticks, ylabel=label)
    else:
        axes.set(xlim=(0, 360), xticks=ticks, xlabel=label)


def save_figure(figure: Figure, paths: Mapping[str, Path]) -> None:
    """Write a figure as ``png`` (150 dpi), ``pdf`` or ``svg``; a figure gives the same bytes."""
    with mpl.rc_context(RC):
        for kind, path in paths.items():
            with replacing(path) as temporary:
                figure.savefig(temporary, format=kind, **_SAVED[kind])

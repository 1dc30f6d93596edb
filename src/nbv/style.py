"""Style of all figures: colours for the colour-blind, markers that survive grey print."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.typing import LineStyleType

from nbv.files import replacing

INK = "#222222"
MUTED = "#666666"
GRID = "#d9d9d9"
SHADE = "#e4e4e4"
FOR, OPEN, AGAINST = "#00664a", "#6b5500", "#9c2a00"
"""Colours of a difference: in favour, undecided, against."""

RC: Any = {
    # Overrides the user's matplotlibrc.
    **{key: value for key, value in mpl.rcParamsDefault.items() if key != "backend"},
    # DejaVu Sans comes with matplotlib. Verdana has the same width, for SVG viewers without it.
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "hatch.linewidth": 0.7,
    "pdf.fonttype": 42,
    # Text stays text: small, sharp at every size, searchable.
    "svg.fonttype": "none",
    "svg.hashsalt": "nbv",
}
"""Matplotlib settings for building and saving figures."""

SAVED: Mapping[str, Mapping[str, Any]] = {
    "png": {"dpi": 150, "metadata": {"Software": None}},
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
}
"""Settings of each file format that make saved figures reproducible."""


@dataclass(frozen=True)
class MethodStyle:
    """A method's colour, line, marker and hatch in every figure."""

    color: str
    line: LineStyleType
    marker: str
    hatch: str
    width: float = 1.5

    @property
    def curve(self) -> dict[str, Any]:
        """Arguments that draw the method's curves, without markers."""
        return {"color": self.color, "linestyle": self.line, "linewidth": self.width}


_STYLES: Mapping[str, MethodStyle] = {
    "single": MethodStyle("#000000", (0, (1.0, 1.2)), "o", ""),
    "random": MethodStyle("#E69F00", (0, (5.0, 2.0)), "s", "////"),
    "opposite": MethodStyle("#0072B2", (0, (6.0, 1.5, 1.0, 1.5)), "^", "\\\\\\\\"),
    "proposed": MethodStyle("#D55E00", "solid", "D", "", 2.2),
}
_FURTHER = (
    MethodStyle("#009E73", (0, (3.0, 1.0)), "v", "xxxx"),
    MethodStyle("#CC79A7", (0, (8.0, 2.0)), "P", "||||"),
    MethodStyle("#56B4E9", (0, (4.0, 1.0, 1.0, 1.0, 1.0, 1.0)), "X", "++++"),
    MethodStyle("#8C6D00", (0, (2.0, 2.0)), "<", "oo"),
)
_ERROR, _GAIN, _DISPERSION, _FIXED = _FURTHER
# By policy: the colour shows the policy, the line the fusion.
_POLICIES: Mapping[str, MethodStyle] = {
    "random": _STYLES["random"],
    "opposite": _STYLES["opposite"],
    "bisecting": _STYLES["opposite"],
    "ambiguity": _STYLES["proposed"],
    "pose_ambiguity": _STYLES["proposed"],
    "error": _ERROR,
    "expected_error": _ERROR,
    "gain": _GAIN,
    "information_gain": _GAIN,
    "dispersion": _DISPERSION,
    "expected_dispersion": _DISPERSION,
    "fixed": _FIXED,
    "either_way": _FIXED,
    "evenly_spaced": _FIXED,
}
_FUSIONS: Mapping[str, LineStyleType] = {
    "average": (0, (1.0, 1.2)),
    "posterior": "solid",
    "product": (0, (6.0, 1.5, 1.0, 1.5)),
    "selected": (0, (5.0, 2.0)),
}


def method_style(method: str, methods: tuple[str, ...]) -> MethodStyle:
    """Return a method's style.

    An extension has the style of the policy and the fusion in its name; other names have the
    further styles in order.
    """
    if method in _STYLES:
        return _STYLES[method]
    if method in _POLICIES:
        return _POLICIES[method]
    policy, _, fusion = method.rpartition("_")
    if policy in _POLICIES and fusion in _FUSIONS:
        return replace(_POLICIES[policy], line=_FUSIONS[fusion], width=1.5)
    others = [name for name in methods if name not in _STYLES]
    return _FURTHER[others.index(method) % len(_FURTHER)]


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that needs neither a display nor global state."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


@dataclass(frozen=True)
class Panels:
    """A figure of several panels, and the spare cell if there is one."""

    figure: Figure
    panels: list[Axes]
    spare: Axes | None

    def add_key(self, handles: Sequence[Artist]) -> Legend:
        """Draw one legend, in the spare cell or else below all panels."""
        if self.spare is not None:
            return self.spare.legend(handles=handles, loc="center", handlelength=3.2)
        longest = max(len(str(handle.get_label())) for handle in handles)
        fitting = int(self.figure.get_figwidth() // (0.07 * longest + 0.7))
        columns = max(1, min(len(handles), 2 * len(self.panels), fitting))
        rows = -(-len(handles) // columns)
        self.figure.set_figheight(self.figure.get_figheight() + 0.2 * rows)
        return self.figure.legend(
            handles=handles, loc="outside lower center", ncols=columns, handlelength=3.2
        )


def panel_grid(
    n_panels: int, width_in: float, height_in: float, abreast: Sequence[int] = (3, 2, 4)
) -> Panels:
    """Return a figure of panels, the first number per row that leaves at most one cell empty."""
    columns = min(abreast, key=lambda n: max(-n_panels % n - 1, 0))
    columns = min(columns, n_panels)
    rows = -(-n_panels // columns)
    figure = new_figure(max(width_in * columns, 5.4), height_in * rows + 0.4)
    cells = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for left_over in cells[n_panels:]:
        left_over.set_axis_off()
    return Panels(figure, cells[:n_panels], cells[n_panels] if cells[n_panels:] else None)


def mark_azimuth(axes: Axes, azimuth_deg: float, name: str) -> None:
    """Mark an azimuth or a rotation by a line, with its name at the top."""
    axes.axvline(azimuth_deg, color=INK, linewidth=1.0, linestyle=":")
    right = azimuth_deg < 180
    axes.annotate(
        name,
        (azimuth_deg, 1.0),
        (4 if right else -4, -3),
        xycoords=axes.get_xaxis_transform(),
        textcoords="offset points",
        ha="left" if right else "right",
        va="top",
        fontsize=8,
    )


def azimuth_axis(axes: Axes, label: str, vertical: bool = False) -> None:
    """Label an axis of degrees every 90."""
    ticks = [0, 90, 180, 270, 360]
    if vertical:
        axes.set(ylim=(0, 360), yticks=ticks, ylabel=label)
    else:
        axes.set(xlim=(0, 360), xticks=ticks, xlabel=label)


def draw_estimate(
    axes: Axes,
    row: float,
    style: MethodStyle,
    ours: tuple[float, float, float],
    published: float,
) -> None:
    """Draw a value with its interval in a row, and the published value as an open marker."""
    value, low, high = ours
    axes.plot([low, high], [row, row], color=style.color, linewidth=1.4)
    filled: Any = {"markerfacecolor": style.color, "markeredgecolor": INK, "markeredgewidth": 0.6}
    axes.plot(value, row, marker=style.marker, markersize=5, **filled)
    if np.isfinite(published):
        opened: Any = {"markerfacecolor": "none", "markeredgecolor": style.color}
        axes.plot(published, row, marker=style.marker, markersize=5, markeredgewidth=1.2, **opened)


def label_rows(axes: Axes, labels: Sequence[str], headings: Sequence[int]) -> None:
    """Label the rows of a figure from the top; `headings` are the indices of headings."""
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    for row in headings:
        axes.get_yticklabels()[row].set_fontweight("bold")
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=8)
    axes.xaxis.label.set_fontsize(8)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.spines["left"].set_visible(False)
    axes.grid(visible=False, axis="y")


def saved_as(figure: Figure, kind: str) -> bytes:
    """Return a figure's file of a kind of `SAVED`, always the same for the same figure."""
    with mpl.rc_context(RC), io.BytesIO() as file:
        figure.savefig(file, format=kind, **SAVED[kind])
        return file.getvalue()


def save_figure(figure: Figure, paths: Mapping[str, Path]) -> None:
    """Write a figure reproducibly as ``png`` (150 dpi), ``pdf`` or ``svg``."""
    for kind, path in paths.items():
        # In memory first, because matplotlib's PDF writer has no clear message for a full disk.
        whole = saved_as(figure, kind)
        with replacing(path) as temporary:
            temporary.write_bytes(whole)

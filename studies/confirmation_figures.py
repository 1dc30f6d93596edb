"""Figures of the contrasts of docs/reference/confirmation/protocol.md."""

from __future__ import annotations

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nbv.labels import category_label, interval_text
from nbv.style import AGAINST, FOR, INK, OPEN, RC, label_rows, new_figure
from studies.confirmation import ALL

_DIFFERENCE = "Difference of MAE (degrees), below 0 is better"
_ROW_IN = 0.15
_PANEL_IN = 0.75
_BETTER, _UNDECIDED, _WORSE = "better", "undecided", "worse"
# Colour and marker, so that verdicts are distinct in grey and for colour-blind readers.
_VERDICTS = {_BETTER: (FOR, "o"), _UNDECIDED: (OPEN, "s"), _WORSE: (AGAINST, "X")}


@mpl.rc_context(RC)
def answers_figure(contrasts: pd.DataFrame) -> Figure:
    """Draw the answers over all categories to the questions of the protocol.

    A heading per question and fusion, and below it a row per data set.

    Parameters
    ----------
    contrasts : DataFrame
        From `studies.confirmation.method_contrasts`.

    Raises
    ------
    ValueError
        Where no contrast answers a question.
    """
    # A data set of one category has no rows over all.
    several = contrasts.groupby("dataset")["category"].transform("nunique") > 1
    answers = _answers(contrasts[~several | (contrasts["category"] == ALL)])
    labels: list[str] = []
    headings = []
    figure = new_figure(7.4, _ROW_IN * sum(1 + len(part) for _, part in answers) + 0.9)
    axes = figure.subplots()
    for heading, part in answers:
        headings.append(len(labels))
        labels.append(heading)
        for _, row in part.iterrows():
            _draw_difference(axes, row, len(labels))
            text = interval_text(row["difference_deg"], row["low"], row["high"])
            axes.annotate(
                text,
                (1.02, len(labels)),
                xycoords=axes.get_yaxis_transform(),
                va="center",
                fontsize=8,
            )
            labels.append(str(row["dataset"]))
    axes.axvline(0.0, color=INK, linewidth=0.8)
    label_rows(axes, labels, headings)
    axes.set_xlabel(_DIFFERENCE)
    _verdict_key(figure, answers)
    return figure


@mpl.rc_context(RC)
def contrasts_figure(contrasts: pd.DataFrame) -> Figure:
    """Draw, by category, the contrasts that answer the questions of the protocol.

    A row per contrast and fusion, in the order of the questions, with a panel per data set. Same
    parameter and error as `answers_figure`.
    """
    answers = _answers(contrasts)
    rows = [
        (heading, [panel for _, panel in part.groupby("dataset", sort=False)])
        for heading, part in answers
    ]
    n_columns = max(len(panels) for _, panels in rows)
    heights = [_PANEL_IN + _ROW_IN * max(map(len, panels)) for _, panels in rows]
    figure = new_figure(max(4.2 * n_columns, 5.4), sum(heights) + 0.5)
    cells = figure.subplots(
        len(rows), n_columns, squeeze=False, height_ratios=heights, sharex="row"
    )
    for panel_row, (heading, panels) in zip(cells, rows, strict=True):
        for i, (axes, part) in enumerate(zip(panel_row, panels, strict=False)):
            _forest(axes, part)
            axes.set_title(
                f"{'' if i else heading}\n{part['dataset'].iloc[0]} (degrees)", loc="left"
            )
        for spare in panel_row[len(panels) :]:
            spare.remove()
    for axes in cells[-1][: len(rows[-1][1])]:
        axes.set_xlabel(_DIFFERENCE)
    _verdict_key(figure, answers)
    return figure


def _answers(contrasts: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return the contrasts that answer a question, by question and fusion, with headings."""
    answers = contrasts[contrasts["question"] > 0].sort_values(
        ["question", "fusion"], kind="stable"
    )
    if answers.empty:
        raise ValueError("no contrast answers a question")
    groups = answers.groupby(["question", "contrast", "fusion"], sort=False)
    return [
        (f"{question}. {_contrast(str(contrast))}, {fusion}", part)
        for (question, contrast, fusion), part in groups
    ]


def _verdict_key(figure: Figure, answers: list[tuple[str, pd.DataFrame]]) -> None:
    verdicts = {_verdict(row) for _, part in answers for _, row in part.iterrows()}
    handles = [
        Line2D([], [], color=colour, marker=marker, linestyle="none", label=verdict)
        for verdict, (colour, marker) in _VERDICTS.items()
        if verdict in verdicts
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _draw_difference(axes: Axes, row: pd.Series, y: int) -> None:
    colour, marker = _VERDICTS[_verdict(row)]
    axes.plot([row["low"], row["high"]], [y, y], color=colour, linewidth=1.4)
    axes.plot(row["difference_deg"], y, color=colour, marker=marker, markersize=5)


def _forest(axes: Axes, contrasts: pd.DataFrame) -> None:
    for y, (_, row) in enumerate(contrasts.iterrows()):
        _draw_difference(axes, row, y)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    labels = [category_label(str(category)) for category in contrasts["category"]]
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")


def _verdict(row: pd.Series) -> str:
    return _WORSE if row["low"] > 0 else _BETTER if row["high"] < 0 else _UNDECIDED


def _contrast(name: str) -> str:
    return name.replace("_", " ").replace(" - ", " less ").capitalize()

"""Forest plots of the paper's claims: all in one plot, and a plot for each claim."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nbv.experiment.paper import statements
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.published import METHODS
from nbv.experiment.paper.statements import (
    STATISTIC_LABELS,
    AtLeast,
    Claim,
    Comparable,
    Comparison,
    FreeOfOutliers,
    Interval,
    Statement,
    Term,
    Verdict,
    images_text,
    term_text,
)
from nbv.experiment.statistics.paired import LOWER_IS_BETTER, UNIT_OF
from nbv.labels import MINUS, method_label, number
from nbv.style import (
    AGAINST,
    FOR,
    INK,
    OPEN,
    RC,
    SHADE,
    draw_estimate,
    label_rows,
    method_style,
    new_figure,
)

ClaimRow = Mapping[Hashable, Any]
"""A row of the claims' table by column."""

WIDTH_IN = 3.9
_ROW_IN = 0.185
_TICKS = (-20, -10, -5, -2, -0.5, 0, 0.5, 2, 5, 10, 20)
_VERDICTS: Mapping[Verdict, tuple[str, str, str]] = {
    statements.HOLDS: ("Hold", FOR, "o"),
    statements.UNDECIDED: ("Undecided", OPEN, "s"),
    statements.FAILS: ("Do not hold", AGAINST, "X"),
}


@dataclass(frozen=True)
class _Decided:
    """A claim, its verdict, and how far its deciding comparison favours it, or that in words."""

    title: str
    verdict: Verdict
    favour: Interval
    text: str = ""


@mpl.rc_context(RC)
def claims_forest(judged: pd.DataFrame) -> Figure:
    """Draw all claims that were run: how far each is favoured, with interval and verdict.

    `judged` comes from `nbv.experiment.paper.verdicts.read_claims`.
    """
    claims = [_decided(claim, rows) for claim, rows in _rows_of(judged)]
    groups = {
        verdict: [claim for claim in claims if claim.verdict == verdict]
        for verdict in _VERDICTS
        if any(claim.verdict == verdict for claim in claims)
    }
    n_rows = len(claims) + len(groups)
    figure = new_figure(WIDTH_IN, _ROW_IN * n_rows + 0.6)
    axes = figure.subplots()
    # A few differences are ten times as large as most.
    signed_root = (lambda x: np.sign(x) * np.sqrt(np.abs(x)), lambda root: root * np.abs(root))
    axes.set_xscale("function", functions=signed_root)
    labels: list[str] = []
    headings = []
    for verdict, members in groups.items():
        words, color, marker = _VERDICTS[verdict]
        headings.append(len(labels))
        labels.append(f"{words}: {len(members)}")
        axes.plot(0, len(labels) - 1, linestyle="none")
        for claim in members:
            (value, low, high), row = claim.favour, len(labels)
            if claim.text:
                beside: Any = {"textcoords": "offset points", "va": "center", "fontsize": 8}
                axes.annotate(claim.text, (value, row), (5, 0), **beside)
            axes.plot([low, high], [row, row], color=color, linewidth=1.6)
            axes.plot(value, row, marker=marker, color=color, markersize=5.5)
            labels.append(claim.title)
    # Where there is more room: half of the axes is enough.
    right = sum(axes.get_xlim()) > 0
    for text in axes.texts:
        text.set(position=(5 if right else -5, 0), ha="left" if right else "right")
    axes.axvline(0, color=INK, linewidth=0.9)
    axes.set(xticks=_TICKS, xlim=axes.get_xlim())
    label_rows(axes, labels, headings)
    for row, (_, color, _) in zip(headings, map(_VERDICTS.__getitem__, groups), strict=True):
        axes.get_yticklabels()[row].set_color(color)
    axes.set_xlabel(f"{MINUS} against the claim     for it +\n(degrees, or points of pAUC)")
    return figure


@mpl.rc_context(RC)
def claim_figure(claim: Claim, rows: Mapping[Comparison, ClaimRow]) -> Figure:
    """Draw the comparisons of one claim: our differences with their intervals, and the paper's.

    `rows` are those of `comparisons_of`.
    """
    drawn = list(_differences(claim, rows))
    groups = list(dict.fromkeys(difference.group for difference in drawn))
    series = {difference.name: difference for difference in drawn}
    single_group = len(groups) == 1
    labels = list(series) if single_group else groups
    per_row = 1 if single_group else len(series)
    key = per_row > 1
    height = _ROW_IN * len(labels) * max(1.0, 0.6 * per_row)
    margin = max(difference.margin for difference in drawn)
    further_in = (0.22 if key else 0.0) + (0.16 if margin else 0.0)
    figure = new_figure(WIDTH_IN, height + 0.8 + further_in)
    axes = figure.subplots()
    if margin:
        axes.axvspan(-margin, margin, color=SHADE, linewidth=0)
    for difference in drawn:
        row = labels.index(difference.name if single_group else difference.group)
        place = list(series).index(difference.name) - (per_row - 1) / 2
        offset = 0.0 if single_group else place * 0.75 / per_row
        style = method_style(difference.method, METHODS)
        draw_estimate(axes, row + offset, style, difference.ours, difference.published)
    axes.axvline(0, color=INK, linewidth=0.9)
    label_rows(axes, labels, [])
    subject = "" if single_group else f"{_subject(list(series))}: "
    comparable = f"\ngrey: comparable (±{margin:g})" if margin else ""
    axes.set_xlabel(f"{subject}{drawn[0].quantity}\n{drawn[0].direction}{comparable}")
    if key:
        figure.legend(
            handles=[_key(difference) for difference in series.values()],
            loc="outside lower center",
            ncols=min(len(series), 4),
            fontsize=8,
            handlelength=1.2,
        )
    return figure


def _subject(names: list[str]) -> str:
    """Return the common form of several differences, such as ``each method − Single``."""
    ends = [name.split(f" {MINUS} ") for name in names]
    if any(len(pair) != 2 for pair in ends):
        return names[0]
    first, second = ({pair[i] for pair in ends} for i in (0, 1))
    shared = (part.pop() if len(part) == 1 else "each method" for part in (first, second))
    return f" {MINUS} ".join(shared)


def comparisons_of(judged: pd.DataFrame) -> dict[str, dict[Comparison, ClaimRow]]:
    """Return the rows of the claims that were run, by claim id and comparison."""
    return {claim.id: rows for claim, rows in _rows_of(judged)}


def _rows_of(judged: pd.DataFrame) -> Iterator[tuple[Claim, dict[Comparison, ClaimRow]]]:
    by_claim = {str(name): part for name, part in judged.groupby("id", sort=False)}
    for claim in CLAIMS:
        parts = by_claim[claim.id].sort_values("part").to_dict("records")
        if parts[0]["verdict"] != statements.NOT_RUN:
            yield claim, dict(zip(statements.leaves(claim.statement), parts, strict=True))


def deciding_comparison(claim: Claim, rows: Mapping[Comparison, ClaimRow]) -> Comparison:
    """Return the comparison that decides a claim; `rows` are those of `comparisons_of`."""
    verdicts = {part: row["part_verdict"] for part, row in rows.items()}
    values = {part: statements.favour_of(part, row)[0] for part, row in rows.items()}
    return statements.deciding(claim.statement, verdicts, values)


def _decided(claim: Claim, rows: Mapping[Comparison, ClaimRow]) -> _Decided:
    part = deciding_comparison(claim, rows)
    verdict = rows[part]["verdict"]
    if isinstance(part, FreeOfOutliers):
        text = f"{number(rows[part]['value'], 0)} % outliers"
        return _Decided(claim.title, verdict, (0.0, 0.0, 0.0), text)
    return _Decided(claim.title, verdict, statements.favour_of(part, rows[part]))


@dataclass(frozen=True)
class _Difference:
    """One mark of a plot: its row, series, value and interval."""

    group: str
    name: str
    method: str
    quantity: str
    direction: str
    ours: Interval
    published: float
    margin: float


def _differences(claim: Claim, rows: Mapping[Comparison, ClaimRow]) -> Iterator[_Difference]:
    labels = dict(_labels(claim.statement))
    several = len({part.statistic for part in rows if not isinstance(part, FreeOfOutliers)}) > 1
    pairs = {part: _pair(part) for part in rows if not isinstance(part, FreeOfOutliers)}
    # A mark has the colour of the other method, unless several methods are compared with one.
    several_methods = len({a.method for a, _ in pairs.values()}) > 1
    drawn: set[tuple[str, Term, Term]] = set()
    for part, row in rows.items():
        if row["part_verdict"] == statements.NOT_RUN:
            continue
        if isinstance(part, FreeOfOutliers):
            value = float(row["value"])
            yield _Difference(
                group=images_text(part.a),
                name=method_label(part.a.method),
                method=part.a.method,
                quantity="errors above the fence (%)",
                direction="at 0: no outlier",
                ours=(value, value, value),
                published=np.nan,
                margin=0.0,
            )
            continue
        a, b = pairs[part]
        if (part.statistic, a, b) in drawn:
            continue
        drawn.add((part.statistic, a, b))
        sign = 1.0 if a == part.a else -1.0
        ends = sorted(sign * float(row[name]) for name in ("ci_low", "ci_high"))
        published = float(row["published_value"]) - float(row["published_versus_value"])
        statistic = STATISTIC_LABELS[part.statistic]
        side = "below" if LOWER_IS_BETTER[part.statistic] else "above"
        unit = "degrees" if UNIT_OF[part.statistic] == "°" else "points"
        group = labels.get(part) or (statistic if several else images_text(a))
        yield _Difference(
            group=group,
            name=_pair_text(a, b),
            method=a.method if several_methods else b.method,
            quantity=f"difference of {'MAE and σ' if several else statistic} ({unit})",
            direction=f"{side} 0: the first is better",
            ours=(sign * float(row["difference"]), ends[0], ends[1]),
            published=sign * published,
            margin=part.margin if isinstance(part, Comparable) else 0.0,
        )


def _pair(part: statements.Better | Comparable) -> tuple[Term, Term]:
    """Return the two terms of a comparison, later methods of the paper first."""
    a, b = part.a, part.b
    return (a, b) if METHODS.index(a.method) >= METHODS.index(b.method) else (b, a)


def _pair_text(a: Term, b: Term) -> str:
    if images_text(a) == images_text(b):
        return f"{method_label(a.method)} {MINUS} {method_label(b.method)}"
    return f"{term_text(a)} {MINUS} {term_text(b)}"


def _labels(statement: Statement, label: str = "") -> Iterator[tuple[Comparison, str]]:
    """Yield each comparison with the label of the compound that it is a part of."""
    if isinstance(statement, AtLeast):
        for part in statement.parts:
            yield from _labels(part, statement.label or label)
    else:
        yield statement, label


def _key(difference: _Difference) -> Line2D:
    style = method_style(difference.method, METHODS)
    name = method_label(difference.method)
    return Line2D([], [], color=style.color, marker=style.marker, markersize=5, label=name)


@mpl.rc_context(RC)
def table_picture(cells: pd.DataFrame) -> Figure:
    """Draw a table of MAE by row and method from the cells of ``table1.csv``."""
    shown = cells[cells["metric"] == "mae"]
    methods = tuple(dict.fromkeys(shown["method"].astype(str)))
    rows = list(shown.groupby("row_label", sort=False))
    figure = new_figure(WIDTH_IN, _ROW_IN * (len(shown) + len(rows)) + 0.6)
    axes = figure.subplots()
    labels: list[str] = []
    headings = []
    for name, part in rows:
        headings.append(len(labels))
        labels.append(str(name))
        for cell in part.to_dict("records"):
            ours = float(cell["value"]), float(cell["ci_low"]), float(cell["ci_high"])
            style = method_style(str(cell["method"]), methods)
            draw_estimate(axes, len(labels), style, ours, float(cell["published"]))
            labels.append(method_label(str(cell["method"])))
    label_rows(axes, labels, headings)
    axes.set_xlim(left=0)
    key = "filled: ours, 95 % interval"
    if np.isfinite(shown["published"]).any():
        key += "; open: the paper's"
    axes.set_xlabel(f"MAE (degrees)\n{key}")
    return figure

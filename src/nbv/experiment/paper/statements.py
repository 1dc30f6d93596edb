"""Statements about results, and the rules for their verdicts.

A statement is one comparison or a compound of statements. Each gets one of four verdicts:

``holds``
    *Better(statistic, a, b)*: the 95 % interval of the paired difference excludes zero on the
    side that favours `a`. *Comparable(statistic, a, b, margin)*: the interval lies inside
    ±margin. *FreeOfOutliers(a)*: no error lies above the upper quartile by more than 1.5 times
    the interquartile range. *AtLeast(k, parts)*: k parts hold.
``does not hold``
    The interval excludes zero on the other side; it lies outside ±margin altogether; there is
    an outlier; so many parts do not hold that k cannot be reached.
``undecided``
    Neither: the interval includes zero, or extends over the margin. Also wherever fewer than
    `FEWEST_OBJECTS` test objects are resampled together (those of a category; for σ over folds,
    those of a fold), because an interval over so few is meaningless.
``not run``
    Its subject was not evaluated. A compound is ``not run`` where its verdict depends on parts that
    were not run.

Intervals are not corrected for the number of comparisons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import pandas as pd

from nbv.experiment.results import Unit
from nbv.experiment.statistics.paired import LOWER_IS_BETTER, UNIT_OF
from nbv.labels import category_label, interval_text, method_label, number

Verdict = Literal["holds", "does not hold", "undecided", "not run"]

HOLDS: Verdict = "holds"
FAILS: Verdict = "does not hold"
UNDECIDED: Verdict = "undecided"
NOT_RUN: Verdict = "not run"
VERDICTS: tuple[Verdict, ...] = (HOLDS, FAILS, UNDECIDED, NOT_RUN)

TUKEY_FACTOR = 1.5
FEWEST_OBJECTS = 5
"""The least number of test objects for a decided verdict."""


@dataclass(frozen=True)
class Term:
    """One method on some images: whole units pooled, or one group, fold or set of azimuths."""

    method: str
    units: tuple[Unit, ...]
    group: int | None = None
    fold: int | None = None
    initial_deg: tuple[int, ...] = ()


@dataclass(frozen=True)
class Better:
    """`a` has the better statistic: lower, or for a pAUC higher."""

    statistic: str
    a: Term
    b: Term


@dataclass(frozen=True)
class Comparable:
    """The statistics differ by less than `margin`, in the statistic's unit."""

    statistic: str
    a: Term
    b: Term
    margin: float


@dataclass(frozen=True)
class FreeOfOutliers:
    """No error is an outlier by Tukey's rule."""

    a: Term


@dataclass(frozen=True)
class AtLeast:
    """At least `count` of the parts hold; `label` names the compound among its siblings."""

    count: int
    parts: tuple[Statement, ...]
    label: str = ""


Interval = tuple[float, float, float]
"""A value, and the low and the high end of its interval."""

Comparison = Better | Comparable | FreeOfOutliers
Statement = Comparison | AtLeast


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, with the comparison in words and as a statement.

    The title is short, for plots.
    """

    id: str
    section: str
    sentence: str
    compared: str
    statement: Statement
    note: str = ""
    title: str = ""


def all_of(parts: Sequence[Statement], label: str = "") -> AtLeast:
    """Return the compound that holds if every part holds."""
    return AtLeast(len(parts), tuple(parts), label)


def leaves(statement: Statement) -> list[Comparison]:
    """Return the comparisons of a statement, in their order."""
    if isinstance(statement, AtLeast):
        return [leaf for part in statement.parts for leaf in leaves(part)]
    return [statement]


def if_enough(verdict: Verdict, n_objects: int) -> Verdict:
    """Return a verdict, but undecided where too few objects are resampled together."""
    return UNDECIDED if verdict != NOT_RUN and n_objects < FEWEST_OBJECTS else verdict


def interval_verdict(part: Better | Comparable, low: float, high: float) -> Verdict:
    """Return the verdict of a comparison from the interval of a - b."""
    if not (low <= high):
        return NOT_RUN
    _, least, most = in_favour(part, low, low, high)
    return HOLDS if least > 0 else FAILS if most < 0 else UNDECIDED


def combine(count: int, verdicts: Sequence[Verdict]) -> Verdict:
    """Return the verdict of *AtLeast*: decided only where no undecided part could change it."""
    holding = sum(verdict == HOLDS for verdict in verdicts)
    possible = sum(verdict != FAILS for verdict in verdicts)
    if holding >= count:
        return HOLDS
    if possible < count:
        return FAILS
    return NOT_RUN if NOT_RUN in verdicts else UNDECIDED


def in_favour(part: Better | Comparable, value: float, low: float, high: float) -> Interval:
    """Return how far a difference a - b, with its 95 % interval, favours a comparison.

    All are in the statistic's unit. The comparison holds where the low end is above 0 and does not
    hold where the high end is below 0. For *Comparable* it is the distance inside the margin.
    """
    if isinstance(part, Comparable):
        inside = min(abs(low), abs(high)) if low * high > 0 else 0.0
        return (
            part.margin - abs(value),
            part.margin - max(abs(low), abs(high)),
            part.margin - inside,
        )
    return (-value, -high, -low) if LOWER_IS_BETTER[part.statistic] else (value, low, high)


def favour_of(part: Comparison, row: Mapping[Any, Any]) -> Interval:
    """Return how far a comparison is favoured by its row of the claims' table; see `in_favour`."""
    if isinstance(part, FreeOfOutliers):
        return (-float(row["value"]),) * 3
    value, low, high = (float(row[name]) for name in ("difference", "ci_low", "ci_high"))
    return in_favour(part, value, low, high)


def deciding(
    statement: Statement,
    verdicts: Mapping[Comparison, Verdict],
    favours: Mapping[Comparison, float],
) -> Comparison:
    """Return the comparison that decides a statement; its verdict is the statement's.

    For *AtLeast(k, parts)* it is that of the k-th best part: by verdict, and within a verdict by
    `favours`, how far the difference favours it; see `in_favour`. The statement has been run.
    """
    if not isinstance(statement, AtLeast):
        return statement

    def merit(part: Statement) -> tuple[int, float]:
        leaf = deciding(part, verdicts, favours)
        return _MERIT[combine_statement(part, verdicts)], favours[leaf]

    ranked = sorted(statement.parts, key=merit, reverse=True)
    return deciding(ranked[statement.count - 1], verdicts, favours)


_MERIT: Mapping[Verdict, int] = {HOLDS: 2, UNDECIDED: 1, NOT_RUN: 1, FAILS: 0}


def combine_statement(statement: Statement, verdicts: Mapping[Comparison, Verdict]) -> Verdict:
    """Return a statement's verdict from those of its comparisons."""
    if isinstance(statement, AtLeast):
        return combine(
            statement.count, [combine_statement(part, verdicts) for part in statement.parts]
        )
    return verdicts[statement]


Measured = Mapping[Comparison, Mapping[str, Any]]
"""The figures of each comparison, by the column names of the claims' table."""

VERDICT_RULES = (
    "“A below B” holds where the 95 % interval of the paired difference (resampling whole "
    "objects) excludes zero on A's side; it does not hold where it excludes zero on the other "
    "side; otherwise it is undecided.",
    "“Comparable” holds where the interval lies inside the margin, does not hold where it lies "
    "outside altogether.",
    f"With fewer than {FEWEST_OBJECTS} test objects (of a category; of a fold, where σ "
    "over folds is compared) a comparison is undecided whatever its interval.",
    "A compound claim is decided only where no undecided or unevaluated part could change it.",
    "“By point estimates” judges ours as the paper judges its own figures: as they stand, without "
    "intervals. Intervals are not corrected for the number of comparisons.",
    "Our figures: each competitor with the paired difference to the claim's subject and its "
    "interval; of compound claims, the competitor that decides each part.",
)
"""The rules for verdicts, for readers of tables."""


def by_run(claims: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return one row per claim: the claims that were run, and those that were not."""
    each = claims.drop_duplicates("id")
    absent = each["verdict"] == NOT_RUN
    return each[~absent], each[absent]


def term_text(term: Term) -> str:
    """Name a method and the images it is judged on."""
    return f"{method_label(term.method)} ({images_text(term)})"


def summarise(statement: Statement, measured: Measured) -> str:
    """Return the key numbers: every competitor, or the one that decides each part."""
    if isinstance(statement, AtLeast) and any(
        isinstance(part, AtLeast) and part.label for part in statement.parts
    ):
        verdicts = {leaf: row["part_verdict"] for leaf, row in measured.items()}

        def favour(leaf: Comparison) -> float:
            return favour_of(leaf, measured[leaf])[0]

        texts = []
        for part in statement.parts:
            label = part.label if isinstance(part, AtLeast) else ""
            verdict = combine_statement(part, verdicts)
            run = [leaf for leaf in leaves(part) if "value" in measured[leaf]]
            like_it = [leaf for leaf in run if verdicts[leaf] == verdict] or run
            decides = _competition([min(like_it, key=favour)], measured, False) if run else ""
            texts.append(f"{label}: {verdict}" + (f" ({decides})" if decides else ""))
        return "; ".join(texts)
    return _competition(leaves(statement), measured)


def _competition(leaves: Sequence[Comparison], measured: Measured, with_images: bool = True) -> str:
    """Return the value of each subject, with its competitors and their paired differences."""
    rivals: dict[str, list[str]] = {}
    seen: set[tuple[str, frozenset[Term]]] = set()
    for leaf in leaves:
        row = measured[leaf]
        name = term_text(leaf.a) if with_images else method_label(leaf.a.method)
        if "value" not in row:
            rivals[f"{name}: not run"] = []
            continue
        if isinstance(leaf, FreeOfOutliers):
            share, fence = number(row["value"], 1), number(row["versus_value"])
            rivals[f"{category_label(leaf.a.units[0][0])}: {share} % above {fence}°"] = []
            continue
        pair = leaf.statistic, frozenset((leaf.a, leaf.b))
        if pair in seen:
            continue
        seen.add(pair)
        unit = UNIT_OF[leaf.statistic]
        subject = f"{name}, {STATISTIC_LABELS[leaf.statistic]} {number(row['value'])}{unit}"
        same_images = images_text(leaf.a) == images_text(leaf.b)
        rival = method_label(leaf.b.method) if same_images else term_text(leaf.b)
        difference = interval_text(row["difference"], row["ci_low"], row["ci_high"])
        rivals.setdefault(subject, []).append(
            f"{rival} {number(row['versus_value'])}{unit}, difference {difference}"
        )
    return "; ".join(
        f"{subject}, against {', '.join(others)}" if others else subject
        for subject, others in rivals.items()
    )


STATISTIC_LABELS: Mapping[str, str] = {
    "mae": "MAE",
    "pauc": "pAUC",
    "above_90_percent": "errors above 90°",
    "median": "median",
    "mae_sigma": "σ of MAE",
    "pauc_sigma": "σ of pAUC",
}
"""Labels of the statistics."""


def images_text(term: Term) -> str:
    """Name the images that a term is judged on."""
    if len(term.units) > 1:
        where = f"{len(term.units)} categories pooled"
    else:
        where = f"{category_label(term.units[0][0])} {term.units[0][1]}°"
    for name, value in (("group", term.group), ("fold", term.fold)):
        where += f", {name} {value}" if value is not None else ""
    if term.initial_deg:
        where += f", initial azimuths {', '.join(f'{a}°' for a in term.initial_deg)}"
    return where

"""The words of the claims: what was compared, the figures, and how verdicts are reached."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from nbv.experiment.paper import statements
from nbv.experiment.paper.statements import (
    AtLeast,
    Better,
    Comparison,
    FreeOfOutliers,
    Statement,
    Term,
    combine_statement,
)
from nbv.experiment.statistics.paired import LOWER_IS_BETTER, UNIT_OF
from nbv.labels import category_label, interval_text, method_label, number

Measured = Mapping[Comparison, Mapping[str, Any]]
"""The figures of each comparison, by the column names of the claims' table."""

VERDICT_RULES = (
    "“A below B” holds where the 95 % interval of the paired difference (resampling whole "
    "objects) excludes zero on A's side; it does not hold where it excludes zero on the other "
    "side; otherwise it is undecided.",
    "“Comparable” holds where the interval lies inside the margin, does not hold where it lies "
    "outside altogether.",
    f"With fewer than {statements.FEWEST_OBJECTS} test objects (of a category; of a fold, where σ "
    "over folds is compared) a comparison is undecided whatever its interval.",
    "A compound claim is decided only where no undecided or unevaluated part could change it.",
    "“By point estimates” judges ours as the paper judges its own figures: as they stand, without "
    "intervals. Intervals are not corrected for the number of comparisons.",
    "Our figures: each competitor with the paired difference to the claim's subject and its "
    "interval; of compound claims, the closest competitor of each part.",
)
"""How verdicts are reached, for readers."""


def by_run(claims: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return one row per claim: those that were run, decided or not, and those that were not."""
    each = claims.drop_duplicates("id")
    absent = each["verdict"] == statements.NOT_RUN
    return each[~absent], each[absent]


def term_text(term: Term) -> str:
    """Name a method and the images it is judged on."""
    return f"{method_label(term.method)} ({place_text(term)})"


def summarise(statement: Statement, measured: Measured) -> str:
    """Return the figures a reader needs: every competitor, or the closest one of each part."""
    if isinstance(statement, AtLeast) and any(
        isinstance(part, AtLeast) and part.label for part in statement.parts
    ):
        verdicts = {leaf: row["part_verdict"] for leaf, row in measured.items()}
        texts = []
        for part in statement.parts:
            label = part.label if isinstance(part, AtLeast) else ""
            verdict = combine_statement(part, verdicts)
            found = [leaf for leaf in statements.leaves(part) if "value" in measured[leaf]]
            closest = _competition([_closest(found, measured)], measured, False) if found else ""
            texts.append(f"{label}: {verdict}" + (f" ({closest})" if closest else ""))
        return "; ".join(texts)
    return _competition(statements.leaves(statement), measured)


def _competition(leaves: Sequence[Comparison], measured: Measured, place: bool = True) -> str:
    """Return each subject's figure, with its competitors and their paired differences."""
    rivals: dict[str, list[str]] = {}
    told: set[tuple[str, frozenset[Term]]] = set()
    for leaf in leaves:
        row = measured[leaf]
        name = term_text(leaf.a) if place else method_label(leaf.a.method)
        if "value" not in row:
            rivals[f"{name}: not run"] = []
            continue
        if isinstance(leaf, FreeOfOutliers):
            share, fence = number(row["value"], 1), number(row["versus_value"])
            rivals[f"{category_label(leaf.a.units[0][0])}: {share} % above {fence}°"] = []
            continue
        pair = leaf.statistic, frozenset((leaf.a, leaf.b))
        if pair in told:
            continue
        told.add(pair)
        unit = UNIT_OF[leaf.statistic]
        subject = f"{name}, {STATISTIC_LABELS[leaf.statistic]} {number(row['value'])}{unit}"
        same_images = place_text(leaf.a) == place_text(leaf.b)
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
"""How statistics are named."""


def _closest(leaves: Sequence[Comparison], measured: Measured) -> Comparison:
    """Return the comparison that favours its subject least."""

    def advantage(leaf: Comparison) -> float:
        difference = float(measured[leaf].get("difference", 0.0))
        lower = not isinstance(leaf, Better) or LOWER_IS_BETTER[leaf.statistic]
        return -difference if lower else difference

    return min(leaves, key=advantage)


def place_text(term: Term) -> str:
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

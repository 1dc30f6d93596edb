"""The words of the claims: what was compared, the figures, and a table for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from nbv.evaluation import comparisons, paired
from nbv.evaluation.comparisons import (
    AtLeast,
    Comparison,
    FreeOfOutliers,
    Statement,
    Term,
    combine_statement,
)
from nbv.evaluation.layout import number
from nbv.evaluation.settings import category_label, method_label

Measured = Mapping[Comparison, Mapping[str, Any]]
"""The figures of each comparison, by the column names of the claims' table."""


def claims_markdown(claims: pd.DataFrame) -> str:
    """Return one line per claim: sentence, verdict, our figures, and the paper's own."""
    lines = [
        "## The paper's claims",
        "",
        "| Section | The paper says | What is compared | Verdict | Our figures "
        "| The paper's own figures |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in claims.drop_duplicates("id").itertuples():
        note = f" ({row.note})" if row.note else ""
        texts = [row.section, row.sentence, f"{row.compared}{note}", f"**{row.verdict}**"]
        texts += [row.summary or "–", row.published_verdict]
        lines.append("| " + " | ".join(str(text).replace("|", "\\|") for text in texts) + " |")
    return "\n".join([*lines, "", *(f"- {rule}" for rule in VERDICT_RULES)]) + "\n"


VERDICT_RULES = (
    "“A below B” holds where the 95 % interval of the paired difference (resampling whole "
    "objects) excludes zero on A's side; it does not hold where it excludes zero on the other "
    "side; otherwise it is undecided.",
    "“Comparable” holds where the interval lies inside the margin, does not hold where it lies "
    "outside altogether.",
    "A compound claim is decided only where no undecided or unevaluated part could change it.",
    "Intervals are not corrected for the number of comparisons; the paper's own figures are "
    "compared as printed, without intervals.",
)
"""How verdicts are reached, for readers."""


def term_text(term: Term) -> str:
    """Name a method and the images it is judged on."""
    if len(term.units) > 1:
        where = f"{len(term.units)} categories pooled"
    else:
        where = f"{category_label(term.units[0][0])} {term.units[0][1]}°"
    for name, value in (("group", term.group), ("fold", term.fold)):
        where += f", {name} {value}" if value is not None else ""
    if term.initial_deg:
        where += f", initial azimuths {', '.join(f'{a}°' for a in term.initial_deg)}"
    return f"{method_label(term.method)} ({where})"


def summarise(statement: Statement, measured: Measured) -> str:
    """Return the figures that a reader needs: all of a few parts, or a verdict per group."""
    if isinstance(statement, AtLeast) and any(isinstance(p, AtLeast) for p in statement.parts):
        verdicts = {leaf: row["part_verdict"] for leaf, row in measured.items()}
        groups = [
            f"{part.label}: {combine_statement(part, verdicts)}"
            for part in statement.parts
            if isinstance(part, AtLeast) and part.label
        ]
        return "; ".join(groups)
    texts = [_part_text(part, measured[part]) for part in comparisons.leaves(statement)]
    return "; ".join(dict.fromkeys(texts))


def _part_text(part: Comparison, row: Mapping[str, Any]) -> str:
    if row["part_verdict"] == comparisons.NOT_RUN:
        return f"{row['subject']}: not run"
    if isinstance(part, FreeOfOutliers):
        return f"{row['subject']}: {number(row['value'], 1)} % above {number(row['versus_value'])}°"
    unit = paired.UNIT_OF[part.statistic]
    return (
        f"{row['subject']} {number(row['value'])}{unit} against {row['versus']} "
        f"{number(row['versus_value'])}{unit}, difference {number(row['difference'])} "
        f"({number(row['ci_low'])} to {number(row['ci_high'])})"
    )

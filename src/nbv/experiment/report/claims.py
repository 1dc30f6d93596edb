"""The table of claims."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from nbv.experiment.paper.claim_text import VERDICT_RULES, by_run
from nbv.experiment.report.table import Cell, Part, Row, Table


def claims_table(claims: pd.DataFrame) -> Table:
    """Return one row per claim: sentence, verdicts, our figures, and the paper's own.

    Those that were not run come last, under a heading of their own. The CSV file is what
    `nbv.experiment.paper.verdicts.evaluate_claims` returned: a row for each comparison.
    """
    header = (
        "Section",
        "The paper says",
        "What is compared",
        "Verdict",
        "By point estimates",
        "Our figures",
        "The paper's own figures",
    )
    run, not_run = (tuple(map(_row, part.to_dict("records"))) for part in by_run(claims))
    parts = (Part(run), Part(not_run, "Not run"))
    title, n_text = "The paper's claims", len(header)
    return Table(
        "claims", title, title, claims, header, parts, VERDICT_RULES, n_text_columns=n_text
    )


def _row(claim: Mapping[Hashable, Any]) -> Row:
    note = f" ({claim['note']})" if claim["note"] else ""
    return (
        Cell(str(claim["section"])),
        Cell(claim["sentence"]),
        Cell(f"{claim['compared']}{note}"),
        Cell(claim["verdict"]),
        Cell(claim["point_verdict"]),
        Cell(claim["summary"] or "–"),
        Cell(claim["published_verdict"]),
    )

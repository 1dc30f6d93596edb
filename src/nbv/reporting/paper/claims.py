"""The table of claims."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from nbv.paper.claim_text import VERDICT_RULES, by_run
from nbv.reporting.table import Cell, Part, Row, Table


def claims_table(claims: pd.DataFrame) -> Table:
    """Return one row per claim: sentence, verdicts, our figures, and the paper's own.

    Those that were not run come last, under a heading of their own. The CSV file has a row for
    each comparison that claims are made of.

    Parameters
    ----------
    claims : pandas.DataFrame
        Of `nbv.paper.verdicts.evaluate_claims`.
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
    run, not_run = (
        tuple(_row(claim) for claim in part.to_dict("records")) for part in by_run(claims)
    )
    return Table(
        "claims",
        "The paper's claims",
        "The paper's claims",
        claims,
        header,
        (Part(run), Part(not_run, "Not run")),
        VERDICT_RULES,
        n_text_columns=len(header),
    )


def _row(claim: Mapping[Hashable, Any]) -> Row:
    note = f" ({claim['note']})" if claim["note"] else ""
    return (
        Cell(str(claim["section"])),
        Cell(claim["sentence"]),
        Cell(f"{claim['compared']}{note}"),
        Cell(claim["verdict"], bold=True),
        Cell(claim["point_verdict"]),
        Cell(claim["summary"] or "–"),
        Cell(claim["published_verdict"]),
    )

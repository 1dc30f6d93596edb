"""The table of claims."""

from __future__ import annotations

import pandas as pd

from nbv.paper.claim_text import VERDICT_RULES, by_run
from nbv.reporting.markdown import pipe_row


def claims_markdown(claims: pd.DataFrame) -> str:
    """Return one line per claim: sentence, verdicts, our figures, and the paper's own.

    Those that were not run come last, below a heading of their own.
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
    lines = ["## The paper's claims", ""]
    for title, part in zip(("", "### Not run"), by_run(claims), strict=True):
        if part.empty:
            continue
        lines += [title, ""] if title else []
        lines += [pipe_row(header), pipe_row(["---"] * len(header))]
        for row in part.to_dict("records"):
            note = f" ({row['note']})" if row["note"] else ""
            lines.append(
                pipe_row(
                    [
                        str(row["section"]),
                        row["sentence"],
                        f"{row['compared']}{note}",
                        f"**{row['verdict']}**",
                        row["point_verdict"],
                        row["summary"] or "–",
                        row["published_verdict"],
                    ]
                )
            )
        lines.append("")
    return "\n".join([*lines, *(f"- {rule}" for rule in VERDICT_RULES)]) + "\n"

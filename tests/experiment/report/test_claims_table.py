from __future__ import annotations

import pandas as pd
import pytest

from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.report.table import table_html, table_latex, table_markdown
from nbv.experiment.report.tables import claims_table
from table_readers import html_cells, pipe_rows


@pytest.fixture
def claims(evaluations, rng):
    return evaluate_claims(evaluations, rng, 100)


def test_every_claim_has_one_row_and_those_not_run_come_last(claims):
    run, absent = claims_table(claims).parts
    assert len(run.rows) + len(absent.rows) == len(CLAIMS)
    verdicts = [[row[3].text for row in part.rows] for part in (run, absent)]
    assert "not run" not in verdicts[0]
    assert set(verdicts[1]) == {"not run"}
    pd.testing.assert_frame_equal(claims_table(claims).cells, claims)


def test_every_format_shows_every_claim(claims):
    table = claims_table(claims)
    rows = pipe_rows(table_markdown(table))
    assert len(rows) == 2 + len(CLAIMS)  # each part repeats the header
    assert {len(row) for row in rows} == {len(table.header)}
    shown = html_cells(table_html(table))
    for row in rows:
        assert all(text in shown for text in row)
    latex = table_latex(table)
    assert latex.isascii()
    assert not any("nan" in text for text in shown)


def test_without_results_no_claim_was_run(rng):
    (part,) = claims_table(evaluate_claims({}, rng, 10)).parts
    assert part.heading == "Not run"
    assert len(part.rows) == len(CLAIMS)

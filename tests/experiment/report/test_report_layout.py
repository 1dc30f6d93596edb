from __future__ import annotations

import re

import pytest

from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.table import table_html, table_latex, table_markdown
from nbv.experiment.report.tables import TABLES, build_table
from table_readers import html_cells, pipe_rows

QUICK = ReportSettings(n_resamples=100)


@pytest.fixture(scope="module")
def tables(evaluations):
    return {name: build_table(name, evaluations, QUICK) for name in TABLES}


@pytest.mark.parametrize("name", TABLES)
def test_every_format_shows_the_same_rows(tables, name):
    markdown, latex = table_markdown(tables[name]), table_latex(tables[name])
    rows = pipe_rows(markdown)
    assert html_cells(table_html(tables[name])) == [cell for row in rows for cell in row]
    body = latex.split("\\midrule\n")[1].split("\\bottomrule")[0].strip().splitlines()
    assert len(body) == len(rows) - 1
    assert all(line.count(" & ") == len(rows[0]) - 1 and line.endswith("\\\\") for line in body)
    assert markdown.count("**") // 2 == latex.count("\\textbf{")


@pytest.mark.parametrize("name", TABLES)
def test_latex_is_balanced_and_plain(tables, name):
    latex = table_latex(tables[name])
    assert latex.isascii()
    assert latex.count("{") - latex.count("\\{") == latex.count("}") - latex.count("\\}")
    for environment in ("table", "tabular"):
        assert latex.count(f"\\begin{{{environment}}}") == 1
        assert latex.count(f"\\end{{{environment}}}") == 1
    assert re.search(r"\\begin\{tabular\}\{lr+\}", latex)
    assert latex.count("\\toprule") == latex.count("\\midrule") == latex.count("\\bottomrule") == 1


def test_the_best_is_the_lowest_error_and_the_highest_pauc(tables):
    for name, best in (("table2", min), ("table4", max)):
        for row in pipe_rows(table_markdown(tables[name]))[1:]:
            values = [float(re.search(r"[\d.]+", cell)[0]) for cell in row[1:5]]
            bold = [value for value, cell in zip(values, row[1:5], strict=True) if "**" in cell]
            assert set(bold) == {(min if row[0].endswith("above 90°") else best)(values)}


def test_the_least_spread_over_folds_is_the_best(tables):
    (sigma,) = (row for row in tables["table7"].rows if row[0].text == "σ")
    for offset in (1, 2):
        values = [float(cell.text.rstrip("°")) for cell in sigma[offset::2]]
        bold = [float(cell.text.rstrip("°")) for cell in sigma[offset::2] if cell.bold]
        assert set(bold) == {min(values)}


def test_the_share_of_errors_above_90_degrees_stands_below_the_figures(tables):
    for name in ("table1", "table2", "table3", "table4", "table5"):
        labels = [row[0].text for row in tables[name].rows]
        half = len(labels) // 2
        assert labels[half:] == [f"{label}: errors above 90°" for label in labels[:half]]


def test_published_figures_are_in_brackets_and_never_bold(tables):
    markdown = table_markdown(tables["table1"])
    assert "[11.03°]" in markdown
    assert not re.search(r"\*\*[^*|]*\[[^*|]*\*\*", markdown)
    assert re.search(r"\*\*[\d.]+°\*\* \[", markdown)


def test_the_last_column_is_the_difference_that_the_cells_have(tables):
    table = tables["table1"]
    assert table.header[-1] == "Proposed − Opposite"
    cells = table.cells[table.cells["method"] == "proposed"]
    for row in table.rows:
        label, *above_90 = row[0].text.split(": ")
        shown = cells[(cells["metric"] == "mae") != bool(above_90)]
        found = shown[shown["row_label"] == label].iloc[0]
        value, low, high = (
            float(text.replace("−", "-")) for text in re.findall(r"[−\d.]+", row[-1].text)
        )
        assert (value, low, high) == pytest.approx(
            (found["difference"], found["difference_low"], found["difference_high"]), abs=0.005
        )


def test_table_6_pairs_ours_with_the_published_example(tables):
    labels = [row[0].text for row in tables["table6"].rows]
    assert labels[:2] == ["0°", "0°, published"]
    assert "342.0° (18.0°)" in [cell.text for cell in tables["table6"].rows[1]]


def test_an_estimate_that_rounds_to_360_degrees_is_zero(evaluations):
    frame = evaluations["mug", 0].copy()
    first = (frame["initial_deg"] == 0) & (frame["method"] == "single")
    frame.loc[first, ["pose_estimate_deg", "error_deg"]] = (359.96, 0.04)
    table = build_table("table6", {("mug", 0): frame}, QUICK)
    texts = [cell.text for cell in table.rows[0]]
    assert "0.0° (0.0°)" in texts
    assert not any("360.0°" in text for text in texts)

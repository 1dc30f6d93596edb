from __future__ import annotations

import html
import re
import shutil
import subprocess
from dataclasses import replace

import pandas as pd
import pytest

from nbv.labels import number
from nbv.reporting.grid import escape_latex
from nbv.reporting.markdown import markdown_to_html, pipe_row
from nbv.reporting.paper.layout import save_table, to_latex, to_markdown
from nbv.reporting.paper.tables import TABLES, build_table
from nbv.reporting.settings import ReportSettings

QUICK = ReportSettings(n_resamples=100)


@pytest.fixture(scope="module")
def tables(evaluations):
    return {name: build_table(name, evaluations, QUICK) for name in TABLES}


def pipe_rows(markdown):
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in markdown.splitlines()
        if line.startswith("|")
    ]


@pytest.mark.parametrize("name", TABLES)
def test_the_twins_are_rectangular_and_agree(tables, name):
    markdown, latex = to_markdown(tables[name]), to_latex(tables[name])
    rows = pipe_rows(markdown)
    assert len({len(row) for row in rows}) == 1
    body = latex.split("\\midrule\n")[1].split("\\bottomrule")[0].strip().splitlines()
    assert len(body) == len(rows) - 2
    assert all(line.count(" & ") == len(rows[0]) - 1 and line.endswith("\\\\") for line in body)
    assert markdown.count("**") // 2 == latex.count("\\textbf{")


@pytest.mark.parametrize("name", TABLES)
def test_latex_is_balanced_and_plain(tables, name):
    latex = to_latex(tables[name])
    assert latex.isascii()
    assert latex.count("{") - latex.count("\\{") == latex.count("}") - latex.count("\\}")
    for environment in ("table", "tabular"):
        assert latex.count(f"\\begin{{{environment}}}") == 1
        assert latex.count(f"\\end{{{environment}}}") == 1
    assert re.search(r"\\begin\{tabular\}\{lr+\}", latex)
    assert latex.count("\\toprule") == latex.count("\\midrule") == latex.count("\\bottomrule") == 1


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_latex_compiles(tables, tmp_path):
    body = "\n".join(to_latex(table) for table in tables.values())
    (tmp_path / "all.tex").write_text(
        f"\\documentclass{{article}}\\usepackage{{booktabs,graphicx}}\\begin{{document}}\n{body}"
        "\\end{document}\n"
    )
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "all.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)


def test_the_best_is_the_lowest_error_and_the_highest_pauc(tables):
    for name, best in (("table2", min), ("table4", max)):
        for row in pipe_rows(to_markdown(tables[name]))[2:]:
            values = [float(re.search(r"[\d.]+", cell)[0]) for cell in row[1:5]]
            bold = [value for value, cell in zip(values, row[1:5], strict=True) if "**" in cell]
            assert set(bold) == {best(values)}


def test_published_stands_in_brackets_and_is_never_bold(tables):
    markdown = to_markdown(tables["table1"])
    assert "[11.03°]" in markdown
    assert not re.search(r"\*\*[^*|]*\[[^*|]*\*\*", markdown)
    assert re.search(r"\*\*[\d.]+°\*\* \[", markdown)


def test_table_6_pairs_ours_with_the_published_example(tables):
    labels = [row[0] for row in pipe_rows(to_markdown(tables["table6"]))[2:]]
    assert labels[:2] == ["0°", "0°, published"]
    assert "342.0° (18.0°)" in to_markdown(tables["table6"])


def test_html_shows_the_same_cells(tables):
    markdown = to_markdown(tables["table7"])
    page = markdown_to_html(markdown, html.escape)
    cells = re.findall(r"<t[dh](?: [^>]*)?>(.*?)</t[dh]>", page)
    shown = [html.unescape(re.sub(r"</?strong>", "**", cell)) for cell in cells]
    rows = pipe_rows(markdown)
    assert shown == [cell for row in [rows[0], *rows[2:]] for cell in row]


def test_saving_writes_three_files(tables, tmp_path):
    paths = save_table(tables["table1"], tmp_path / "tables" / "table1")
    assert [path.name for path in paths] == ["table1.csv", "table1.md", "table1.tex"]
    cells = pd.read_csv(paths[0])
    assert len(cells) == len(tables["table1"].cells)
    assert cells["value"].to_numpy() == pytest.approx(
        tables["table1"].cells["value"].to_numpy(), abs=1e-4
    )


def test_special_characters_are_escaped():
    assert escape_latex("50 % of a_b & c #1 {x} ^~\\") == (
        "50 \\% of a\\_b \\& c \\#1 \\{x\\} \\textasciicircum{}\\textasciitilde{}\\textbackslash{}"
    )
    assert escape_latex("−3° σ") == "$-$3$^\\circ$ $\\sigma$"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-1.234, "\u22121.23"),
        (-0.001, "0.00"),
        (0.0, "0.00"),
        (float("nan"), "–"),
        (12.344, "12.34"),
        (12.346, "12.35"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


def test_an_estimate_that_rounds_to_a_full_turn_is_zero(tables):
    table = tables["table6"]
    cells = table.cells.copy()
    first = (cells["row"] == "0") & (cells["method"] == "single")
    cells.loc[first & (cells["metric"] == "estimate"), "value"] = 359.96
    cells.loc[first & (cells["metric"] == "error"), "value"] = 0.04
    markdown = to_markdown(replace(table, cells=cells))
    assert "0.0° (0.0°)" in markdown
    assert "360.0°" not in markdown


def test_a_bar_within_a_cell_stays_within_it():
    lines = [pipe_row(["a|b", "c"]), pipe_row(["---", "---"]), pipe_row(["|", "d"])]
    page = markdown_to_html("\n".join(lines), html.escape)
    assert re.findall(r"<t[dh](?: [^>]*)?>(.*?)</t[dh]>", page) == ["a|b", "c", "|", "d"]

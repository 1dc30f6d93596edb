import re
import shutil
import subprocess
from dataclasses import replace

import pandas as pd
import pytest

from nbv.experiment.report.table import (
    Cell,
    Part,
    Table,
    escape_latex,
    table_html,
    table_latex,
    table_markdown,
    write_table,
)
from nbv.labels import number
from table_readers import html_cells, pipe_rows

TABLE = Table(
    "example",
    "Table 1: errors | MAE",
    "Errors of a_b & <c>",
    pd.DataFrame({"value": [1.23456, 2.0]}),
    ("Category", "Mine (°)", "σ"),
    (
        (Cell("a|b & c_d"), Cell("1.23°", bold=True, after="[2.34°]"), Cell("–")),
        (Cell("<script>"), Cell("−0.50"), Cell("“100 %”", bold=True)),
    ),
    ("In bold: the best & <only> one.",),
)
TEXTS = [["Category", "Mine (°)", "σ"], ["a|b & c_d", "**1.23°** [2.34°]", "–"]]
TEXTS.append(["<script>", "−0.50", "**“100 %”**"])


def test_markdown_is_a_heading_a_pipe_table_and_a_list():
    assert table_markdown(TABLE) == (
        "## Table 1: errors | MAE\n\n"
        "| Category | Mine (°) | σ |\n| --- | ---: | ---: |\n"
        "| a\\|b & c_d | **1.23°** [2.34°] | – |\n| <script> | −0.50 | **“100 %”** |\n\n"
        "- In bold: the best & <only> one.\n"
    )


def test_every_format_shows_the_same_cells():
    assert pipe_rows(table_markdown(TABLE)) == TEXTS
    assert html_cells(table_html(TABLE)) == [text for row in TEXTS for text in row]
    rows = re.findall(r"^(.*) \\\\$", table_latex(TABLE), re.MULTILINE)
    assert [row.split(" & ") for row in rows] == [
        ["Category", "Mine ($^\\circ$)", "$\\sigma$"],
        ["a|b \\& c\\_d", "\\textbf{1.23$^\\circ$} [2.34$^\\circ$]", "--"],
        ["<script>", "$-$0.50", "\\textbf{``100 \\%''}"],
    ]


def test_html_escapes_everything_that_is_text():
    page = table_html(replace(TABLE, heading="<b>heading</b>", header=("<i>", "b", "c")))
    of_a_table = {"table", "h3", "thead", "tbody", "tr", "th", "td"}
    assert set(re.findall(r"</?(\w+)", page)) == of_a_table | {"div", "strong", "ul", "li"}
    assert "a|b &amp; c_d" in page
    assert "&lt;only&gt;" in page


def test_parts_have_headings_of_their_own():
    table = replace(TABLE, rows=(Part(TABLE.rows[:1]), Part(TABLE.rows[1:], "Not run")))
    assert pipe_rows(table_markdown(table)) == [TEXTS[0], TEXTS[1], TEXTS[0], TEXTS[2]]
    assert "\n\n### Not run\n\n| Category" in table_markdown(table)
    assert table_html(table).count("<tbody>") == 2
    assert "\\multicolumn{3}{l}{\\emph{Not run}} \\\\\n\\midrule" in table_latex(table)
    assert replace(TABLE, rows=(Part(TABLE.rows), Part((), "Not run"))).parts == TABLE.parts


def test_without_rows_the_notes_are_all_there_is():
    table = replace(TABLE, rows=(), notes=("Nothing was run.",))
    assert table_markdown(table) == "## Table 1: errors | MAE\n\nNothing was run.\n"
    assert table_html(table) == "<p>Nothing was run.</p>\n"
    assert "tabular" not in table_latex(table)


def test_words_are_aligned_left_and_long_ones_set_as_paragraphs():
    table = replace(TABLE, n_text_columns=2)
    assert "| --- | --- | ---: |" in table_markdown(table)
    assert "\\begin{tabular}{llr}" in table_latex(table)
    long = replace(table, rows=((Cell("a"), Cell("word " * 40), Cell("1")),))
    assert re.search(r"\\begin\{tabular\}\{lp\{\w+\}r\}", table_latex(long))


def test_a_row_that_is_too_short_is_refused():
    with pytest.raises(ValueError, match="example: 1 cells for 3 columns"):
        replace(TABLE, rows=((Cell("alone"),),))


def test_only_the_formats_asked_for_are_written(tmp_path):
    paths = {kind: tmp_path / "tables" / f"example.{kind}" for kind in ("csv", "html")}
    write_table(replace(TABLE, decimals=2), paths)
    assert sorted(path.name for path in (tmp_path / "tables").iterdir()) == [
        "example.csv",
        "example.html",
    ]
    assert paths["csv"].read_text() == "value\n1.23\n2.0\n"
    assert paths["html"].read_text() == table_html(TABLE)
    with pytest.raises(KeyError, match="xlsx"):
        write_table(TABLE, {"xlsx": tmp_path / "example.xlsx"})


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
        (float("nan"), "–"),
        (12.346, "12.35"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_latex_compiles(tmp_path):
    (tmp_path / "all.tex").write_text(
        "\\documentclass{article}\\usepackage{booktabs,graphicx}\\begin{document}\n"
        f"{table_latex(TABLE)}\\end{{document}}\n"
    )
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "all.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)


def test_a_caution_is_the_first_note_of_every_format(tmp_path):
    paths = {kind: tmp_path / f"example.{kind}" for kind in ("md", "tex", "html")}
    write_table(TABLE, paths, ("Too small.",))
    for path in paths.values():
        text = path.read_text()
        assert 0 < text.index("Too small.") < text.index(TABLE.notes[0].split("<")[0][:10])
    write_table(TABLE, paths)
    assert not any("Too small." in path.read_text() for path in paths.values())

"""Printed tables: tidy cells, the rows that people read, and a writer for each file format.

Templates are filled in one of three environments. `HTML` escapes by itself. `MARKDOWN` and `LATEX`
name their filter, ``md`` and ``tex``, where text goes in; LaTeX is full of braces, so its templates
write ``<< value >>`` and ``<% block %>``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from nbv.files import write_csv, write_text
from nbv.labels import MINUS, interval_text

_LATEX_CHARACTERS: Mapping[str, str] = {
    "\\": "\\textbackslash{}",
    "&": "\\&",
    "%": "\\%",
    "$": "\\$",
    "#": "\\#",
    "_": "\\_",
    "{": "\\{",
    "}": "\\}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
    "°": "$^\\circ$",
    "σ": "$\\sigma$",
    "δ": "$\\delta$",
    "τ": "$\\tau$",
    "φ": "$\\varphi$",
    "×": "$\\times$",
    MINUS: "$-$",
    "–": "--",
    "…": "\\dots{}",
    "→": "$\\rightarrow$",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
    "\u00a0": "~",
}


def escape_latex(text: str) -> str:
    """Escape LaTeX's special characters, degree signs and Greek letters."""
    return "".join(_LATEX_CHARACTERS.get(character, character) for character in text)


def escape_markdown(text: str) -> str:
    """Escape the bars of a text, so that it stays within its cell."""
    return text.replace("|", "\\|")


HTML = Environment(
    loader=PackageLoader("nbv.experiment"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
MARKDOWN = HTML.overlay(autoescape=False)
MARKDOWN.filters = {**HTML.filters, "md": escape_markdown}
LATEX = HTML.overlay(
    autoescape=False,
    block_start_string="<%",
    block_end_string="%>",
    variable_start_string="<<",
    variable_end_string=">>",
    comment_start_string="<#",
    comment_end_string="#>",
)
LATEX.filters = {**HTML.filters, "tex": escape_latex}


_LONGEST_LINE = 60
_PARAGRAPH = "p{18em}"


@dataclass(frozen=True)
class Cell:
    """The text of a cell; `after` follows it, never bold.

    Bold means the same in every table: the best of the methods that a row or a column compares.
    """

    text: str
    bold: bool = False
    after: str = ""


Row = tuple[Cell, ...]

DECIDED = "*: the interval excludes 0, before rounding."
"""The note of tables with differences."""


def difference_cell(value: float, low: float, high: float) -> Cell:
    """Return a difference with its interval, and an asterisk where the interval excludes 0."""
    return Cell(interval_text(value, low, high), after="*" if low > 0 or high < 0 else "")


@dataclass(frozen=True)
class Part:
    """Rows under a heading; without one they follow the table's header."""

    rows: tuple[Row, ...]
    heading: str = ""


@dataclass(frozen=True)
class Table:
    """A printed table.

    Attributes
    ----------
    name : str
        Its file's stem, and its label in LaTeX.
    heading, caption : str
        Above the table in Markdown and HTML, and in LaTeX, which counts tables itself.
    cells : pandas.DataFrame
        One row per figure, with its uncertainty: the CSV file.
    header : tuple of str
        A title for each column.
    rows : tuple of tuple of Cell, or tuple of Part
        Rows as long as the header; the first cell of a row names it. A table without rows shows
        its notes only.
    notes : tuple of str
        Remarks below the table.
    decimals : int
        Decimals of the floats in the CSV file.
    n_text_columns : int
        The number of columns of text, aligned left; the others hold numbers.
    in_sight : int, optional
        The index of a column that narrow pages keep in sight beside the first.

    Raises
    ------
    ValueError
        If a row and the header differ in length.
    """

    name: str
    heading: str
    caption: str
    cells: pd.DataFrame
    header: tuple[str, ...]
    rows: tuple[Row, ...] | tuple[Part, ...]
    notes: tuple[str, ...] = ()
    decimals: int = 4
    n_text_columns: int = 1
    in_sight: int | None = None

    def __post_init__(self) -> None:
        for row in self.all_rows:
            if len(row) != len(self.header):
                raise ValueError(f"{self.name}: {len(row)} cells for {len(self.header)} columns")

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts that have rows."""
        plain = tuple(row for row in self.rows if not isinstance(row, Part))
        named = tuple(row for row in self.rows if isinstance(row, Part))
        return tuple(part for part in (Part(plain), *named) if part.rows)

    @property
    def all_rows(self) -> tuple[Row, ...]:
        """The rows of all parts."""
        return tuple(row for part in self.parts for row in part.rows)


def write_table(table: Table, paths: Mapping[str, Path], caution: Sequence[str] = ()) -> None:
    """Write a table in the formats that have a path: ``csv``, ``md``, ``tex``, ``html``.

    The warnings of `caution` precede its notes.

    Raises
    ------
    KeyError
        If the format is unknown.
    """
    cautious = replace(table, notes=(*caution, *table.notes))
    for kind, path in paths.items():
        _WRITERS[kind](cautious, path)


def table_markdown(table: Table) -> str:
    """Return a heading, a pipe table and the notes as a list."""
    return MARKDOWN.get_template("table.md.j2").render(table=table)


def table_latex(table: Table) -> str:
    r"""Return a ``table`` environment, scaled down to the line width where it is wider.

    Needs ``\usepackage{booktabs,graphicx}``.
    """
    columns = "".join(_latex_column(table, i) for i in range(len(table.header)))
    return LATEX.get_template("table.tex.j2").render(table=table, columns=columns)


def table_html(table: Table) -> str:
    """Return a fragment: a captioned ``<table>`` and the notes as a list, all text escaped."""
    return HTML.get_template("table.html.j2").render(table=table)


def _latex_column(table: Table, index: int) -> str:
    if index >= table.n_text_columns:
        return "r"
    longest = max((len(row[index].text) for row in table.all_rows), default=0)
    return _PARAGRAPH if longest > _LONGEST_LINE else "l"


_WRITERS: Mapping[str, Callable[[Table, Path], None]] = {
    "csv": lambda table, path: write_csv(path, table.cells, table.decimals),
    "md": lambda table, path: write_text(path, table_markdown(table)),
    "tex": lambda table, path: write_text(path, table_latex(table)),
    "html": lambda table, path: write_text(path, table_html(table)),
}

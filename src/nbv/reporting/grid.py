"""Grids of cells as people read them: Markdown and LaTeX twins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from nbv.labels import MINUS
from nbv.reporting.markdown import pipe_row


@dataclass(frozen=True)
class Cell:
    """What a cell says; the best of a row is set bold, `printed` follows it plain."""

    text: str
    best: bool = False
    printed: str = ""


@dataclass(frozen=True)
class Grid:
    """A header, and rows as long as it; the first cell of a row names it."""

    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def grid_markdown(heading: str, grid: Grid, notes: Sequence[str]) -> str:
    """Return a heading, a pipe table and notes as a list."""
    lines = [f"## {heading}", "", pipe_row(grid.header)]
    lines.append(pipe_row(["---"] + ["---:"] * (len(grid.header) - 1)))
    for row in grid.rows:
        texts = [f"**{cell.text}**" if cell.best else cell.text for cell in row]
        printed = [cell.printed for cell in row]
        lines.append(pipe_row([f"{t} {p}".rstrip() for t, p in zip(texts, printed, strict=True)]))
    lines += ["", *(f"- {note}" for note in notes)]
    return "\n".join(lines) + "\n"


def grid_latex(name: str, title: str, grid: Grid, notes: Sequence[str]) -> str:
    r"""Return a ``table`` environment, shrunk to the line where it is wider.

    Needs ``\usepackage{booktabs,graphicx}``.
    """
    lines = [
        "% needs \\usepackage{booktabs,graphicx}",
        "\\begin{table}",
        "\\centering",
        f"\\caption{{{escape_latex(title)}}}",
        f"\\label{{tab:{name}}}",
        "\\small",
        "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%",
        f"\\begin{{tabular}}{{l{'r' * (len(grid.header) - 1)}}}",
        "\\toprule",
        _latex_row([escape_latex(text) for text in grid.header]),
        "\\midrule",
    ]
    for row in grid.rows:
        texts = []
        for cell in row:
            text = escape_latex(cell.text)
            text = f"\\textbf{{{text}}}" if cell.best else text
            texts.append(f"{text} {escape_latex(cell.printed)}".rstrip())
        lines.append(_latex_row(texts))
    lines += ["\\bottomrule", "\\end{tabular}}", "", "\\footnotesize\\raggedright"]
    lines += [f"{escape_latex(note)}\\par" for note in notes]
    return "\n".join([*lines, "\\end{table}"]) + "\n"


_LATEX_CHARACTERS = {
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
    MINUS: "$-$",
    "–": "--",
    "…": "\\dots{}",
    "→": "$\\rightarrow$",
}


def escape_latex(text: str) -> str:
    """Return the text with LaTeX's special characters, degree signs and Greek made safe."""
    return "".join(_LATEX_CHARACTERS.get(character, character) for character in text)


def _latex_row(texts: Sequence[str]) -> str:
    return " & ".join(texts) + " \\\\"

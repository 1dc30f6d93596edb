"""The environments that templates are filled in: Markdown, LaTeX and HTML, each with its escapes.

HTML is escaped by itself. Markdown and LaTeX name their filter, ``md`` and ``tex``, where text goes
in. LaTeX is full of braces, so its templates write ``<< value >>`` and ``<% block %>``.
"""

from __future__ import annotations

from collections.abc import Mapping

from jinja2 import Environment, PackageLoader, StrictUndefined

from nbv.labels import MINUS

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
    """Return the text with LaTeX's special characters, degree signs and Greek made safe."""
    return "".join(_LATEX_CHARACTERS.get(character, character) for character in text)


def escape_markdown(text: str) -> str:
    """Return the text with its bars escaped, so that it stays within its cell."""
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

"""The pieces of an HTML page that needs nothing but itself: no scripts, no links outward."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from nbv.paper.statements import FAILS, HOLDS, NOT_RUN, UNDECIDED

_SIGNS: Mapping[str, str] = {HOLDS: "✓", FAILS: "✗", UNDECIDED: "?", NOT_RUN: "–"}
_CLASSES: Mapping[str, str] = {HOLDS: "holds", FAILS: "fails", UNDECIDED: "open", NOT_RUN: "none"}

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: #1a1a1a;
  background: #fff; margin: 0 auto; padding: 1.5rem; max-width: 76rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.35rem; margin: 2.5rem 0 .75rem; border-bottom: 2px solid #1a1a1a; }
summary { margin: 1rem 0 .5rem; cursor: pointer; font-weight: 600; }
h3 { font-size: 1.05rem; margin: 1.75rem 0 .5rem; }
a { color: #00497a; }
dl.facts { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem;
  margin: 1rem 0; }
dl.facts dt { font-weight: 600; } dl.facts dd { margin: 0; overflow-wrap: anywhere; }
nav ul { columns: 18rem; padding-left: 1.2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .875rem; }
th, td { padding: .35rem .6rem; text-align: right; vertical-align: top;
  border-bottom: 1px solid #ccc; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 2px solid #1a1a1a; vertical-align: bottom; }
tbody th { font-weight: 400; white-space: nowrap; }
table.text { min-width: 48rem; } table.text th, table.text td { text-align: left; }
table.text tbody th { white-space: normal; font-weight: 400; }
.muted { color: #555; font-size: .875em; }
.badge { display: inline-block; padding: .05rem .5rem; border: 1.5px solid; border-radius: .3rem;
  font-weight: 600; white-space: nowrap; }
.holds { color: #00543c; background: #e3f3ec; } .fails { color: #8a2500; background: #fdebe3;
  border-style: double; border-width: 3px; }
.open { color: #5a4500; background: #fdf6dc; border-style: dashed; }
.none { color: #555; background: #f2f2f2; border-style: dotted; }
ul.notes { font-size: .85rem; color: #444; margin: .5rem 0 0; padding-left: 1.2rem; }
figure { margin: 1.5rem 0; } figure img { max-width: 100%; height: auto; }
figcaption { font-size: .9rem; color: #333; max-width: 60rem; }
pre { font-size: .8rem; background: #f6f6f6; border: 1px solid #ddd; padding: .75rem;
  overflow-x: auto; }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  figure, table tr, h2, h3 { break-inside: avoid; } h2, h3 { break-after: avoid; }
  .scroll { overflow: visible; } table.text { min-width: 0; } pre { white-space: pre-wrap; }
}
"""


def escape(text: object) -> str:
    """Return text that is safe in HTML, attributes included."""
    return html.escape(str(text), quote=True)


def page(title: str, body: Iterable[str]) -> str:
    """Return a whole document."""
    return (
        '<!DOCTYPE html>\n<html lang="en-GB">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def badge(verdict: str) -> str:
    """Return a verdict as a word with a sign and a border of its own, so colour is not needed."""
    sign = _SIGNS.get(verdict, "")
    kind = _CLASSES.get(verdict, "none")
    return f'<span class="badge {kind}">{sign} {escape(verdict)}</span>'


def table(header: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    """Return a table of cells that are HTML already; the first of each row heads it."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in header)
    lines = []
    for row in rows:
        cells = "".join(f"<td>{cell}</td>" for cell in row[1:])
        lines.append(f'<tr><th scope="row">{row[0]}</th>{cells}</tr>')
    attribute = f' class="{kind}"' if kind else ""
    return (
        f'<div class="scroll"><table{attribute}><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names and values."""
    items = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in pairs)
    return f'<dl class="facts">{items}</dl>'


def notes(texts: Iterable[str]) -> str:
    """Return a list of remarks."""
    return f'<ul class="notes">{"".join(f"<li>{escape(text)}</li>" for text in texts)}</ul>'


def section(identifier: str, title: str, body: Iterable[str]) -> str:
    """Return a section that the table of contents can point to."""
    inner = "\n".join(body)
    return f'<section id="{identifier}">\n<h2>{escape(title)}</h2>\n{inner}\n</section>'


def inline_image(path: Path, caption: str) -> str:
    """Return a figure with its PNG written into the page."""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure id="{escape(path.stem)}"><img alt="{escape(caption)}" '
        f'src="data:image/png;base64,{data}"><figcaption>{escape(caption)}</figcaption></figure>'
    )

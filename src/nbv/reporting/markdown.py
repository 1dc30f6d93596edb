"""Pipe tables: writing their rows, and turning a whole one into HTML."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable


def pipe_row(texts: Iterable[str]) -> str:
    """Return one row of a pipe table; a bar within a text is escaped."""
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


def markdown_to_html(markdown: str, inline: Callable[[str], str]) -> str:
    """Return the HTML of what `layout.to_markdown` writes, below its heading.

    Parameters
    ----------
    markdown : str
        A pipe table followed by a list of notes; the heading is left to the caller.
    inline : callable
        Escapes text for HTML.
    """
    lines = [line for line in markdown.splitlines() if line and not line.startswith("#")]
    rows = [_split_pipes(line) for line in lines if line.startswith("|")]
    notes = [line.removeprefix("- ") for line in lines if line.startswith("- ")]
    head = "".join(f'<th scope="col">{inline(text)}</th>' for text in rows[0])
    body = []
    for row in rows[2:]:
        cells = [f'<th scope="row">{inline(row[0])}</th>']
        for text in row[1:]:
            shown = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", inline(text))
            cells.append(f"<td>{shown}</td>")
        body.append(f"<tr>{''.join(cells)}</tr>")
    items = "".join(f"<li>{inline(note)}</li>" for note in notes)
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
        + (f'<ul class="notes">{items}</ul>' if items else "")
    )


def _split_pipes(line: str) -> list[str]:
    cells = re.split(r"(?<!\\)\|", line.strip().strip("|"))
    return [cell.strip().replace("\\|", "|") for cell in cells]

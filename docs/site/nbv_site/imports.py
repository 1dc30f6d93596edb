"""The drawing of imports as a table: a Git host draws the graph, which takes a script."""

from __future__ import annotations

import re
from collections.abc import Iterable
from graphlib import TopologicalSorter
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ARROW = re.compile(r"(\w+) --> (\w+)")


def _row(cells: Iterable[str]) -> nodes.row:
    return nodes.row("", *(nodes.entry("", nodes.paragraph("", cell)) for cell in cells))


class Imports(SphinxDirective):
    """A graph of lines ``importing --> imported``."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return a row for each that imports and a column for each that is imported, in order."""
        lines = [line.strip() for line in self.content if line.strip()]
        arrows = [ARROW.fullmatch(line) for line in lines if not line.startswith("graph ")]
        if not all(arrows):
            raise self.error("only lines of the form 'a --> b' are drawn here")
        pairs = {match.groups() for match in arrows if match}
        below: dict[str, list[str]] = {}
        for one, other in sorted(pairs):
            below.setdefault(one, []).append(other)
        order = [*TopologicalSorter(below).static_order()][::-1]
        importing = [name for name in order if name in below]
        imported = [name for name in order if any(other == name for _, other in pairs)]
        body = [
            [one, *("●" if (one, other) in pairs else "" for other in imported)]
            for one in importing
        ]
        group = nodes.tgroup(
            "",
            *(nodes.colspec(colwidth=1) for _ in range(len(imported) + 1)),
            nodes.thead("", _row(["imports", *imported])),
            nodes.tbody("", *map(_row, body)),
            cols=len(imported) + 1,
        )
        return [nodes.table("", group, classes=["imports"])]


def setup(app: Sphinx) -> dict[str, Any]:
    """Take Mermaid's fences."""
    app.add_directive("mermaid", Imports)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

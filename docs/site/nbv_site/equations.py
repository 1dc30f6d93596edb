"""Equations as MathML, which browsers draw themselves: no script, no font, no network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

LOGGER = logging.getLogger(__name__)


def _draw(translator: HTML5Translator, node: nodes.Element, block: bool) -> None:
    try:
        drawn = tex2mathml(node.astext(), as_block=block)
    except MathError as error:
        LOGGER.warning("this equation cannot be typeset: %s", error, location=node)
    else:
        translator.body.append(f'<div class="equation">{drawn}</div>\n' if block else drawn)
    raise nodes.SkipNode


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    _draw(translator, node, block=False)


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    _draw(translator, node, block=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

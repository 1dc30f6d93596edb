"""Docstrings and signatures as they are written: a shape is no type, an alias keeps its name."""

from __future__ import annotations

import inspect
from typing import Any

from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.inspect import stringify_signature


class Shapes(SphinxTransform):
    """Leave the words of `ndarray (n, B) float32` alone; Sphinx would look for a class of each."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Take the links of the words that can name no class."""
        for link in [*self.document.findall(addnodes.pending_xref)]:
            target = link.get("reftarget", "")
            is_word = "." not in target and not target[:1].isupper()
            if link.get("reftype") == "class" and "refspecific" in link and is_word:
                link.replace_self(link.children)


def _as_written(
    app: Sphinx, what: str, name: str, documented: Any, options: Any, *signature: str | None
) -> tuple[str, str] | None:
    """Return a signature with its annotations as in the source: `ArrayLike`, not its members."""
    if what not in {"class", "exception", "function", "method"}:
        return None
    try:
        written = inspect.signature(documented)
    except (TypeError, ValueError):
        return None
    parameters = [*written.parameters.values()]
    if what == "method" and parameters and parameters[0].name == "self":
        parameters = parameters[1:]
    text = stringify_signature(written.replace(parameters=parameters))
    arguments, _, returned = text.partition(" -> ")
    return arguments, "" if what == "class" else returned


def setup(app: Sphinx) -> dict[str, Any]:
    """Show types as they are meant."""
    app.add_transform(Shapes)
    app.connect("autodoc-process-signature", _as_written)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

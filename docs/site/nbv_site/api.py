"""What docstrings call a type is often a shape: `ndarray (n, B) float32` names one class."""

from __future__ import annotations

from typing import Any

from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class Shapes(SphinxTransform):
    """Leave the words of a shape as they are; Sphinx would look for a class of each name."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Take the links of the words that can name no class."""
        for link in [*self.document.findall(addnodes.pending_xref)]:
            target = link.get("reftarget", "")
            is_word = "." not in target and not target[:1].isupper()
            if link.get("reftype") == "class" and "refspecific" in link and is_word:
                link.replace_self(link.children)


def setup(app: Sphinx) -> dict[str, Any]:
    """Read docstrings' types as they are meant."""
    app.add_transform(Shapes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

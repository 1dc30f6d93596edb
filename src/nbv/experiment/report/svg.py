"""Figures as SVG inside a page: in the page's colours, and with names of their own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import BytesIO
from xml.etree import ElementTree

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from nbv.robot.style import AGAINST, FOR, GRID, INK, MUTED, OPEN, RC, SAVED, SHADE

_COLOURS: Mapping[str, str] = {
    INK: "var(--ink)",
    "#000000": "var(--ink)",
    MUTED: "var(--muted)",
    GRID: "var(--line)",
    SHADE: "var(--shade)",
    FOR: "var(--holds)",
    OPEN: "var(--open)",
    AGAINST: "var(--fails)",
    "#ffffff": "var(--page)",
}
_COLOUR = re.compile("|".join(_COLOURS))
_OF_FILE = {"metadata", "style"}
_DECIMALS = re.compile(r"(\.\d\d)\d+(?!e)")
_NAMED = re.compile(r"(?<=url\(#)")


def svg_text(figure: Figure) -> str:
    """Return a figure as an SVG file's text; a figure gives the same text."""
    with mpl.rc_context(RC), BytesIO() as file:
        figure.savefig(file, format="svg", **SAVED["svg"])
        return file.getvalue().decode("utf-8")


def inline_svg(text: str, name: str, label: str) -> Markup:
    """Return an SVG file of `nbv.robot.style.save_figure` as an element of an HTML page.

    Parameters
    ----------
    text : str
        What the file holds.
    name : str
        Its elements are named after it, so that one figure's do not meet another's.
    label : str
        What it shows, for those who do not see it.

    Returns
    -------
    Markup
        An ``svg`` element that scales with its place. Ink, grid, paper and verdicts have the
        page's custom properties for colours, such as ``--ink``; the colours of methods stay.
    """
    root = ElementTree.fromstring(text)
    for parent in root.iter():
        for child in [one for one in parent if _local(one.tag) in _OF_FILE]:
            parent.remove(child)
        parent.tag = _local(parent.tag)
        parent.attrib = {
            _local(key): _of_page(_local(key), value, name) for key, value in parent.attrib.items()
        }
    root.attrib = {"viewBox": root.attrib["viewBox"], "width": root.attrib["width"]}
    root.attrib |= {"class": "drawing", "role": "img", "aria-label": label}
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def _of_page(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key in ("d", "transform"):
        return _DECIMALS.sub(r"\1", value.replace("\n", ""))
    if key == "style":
        value = _COLOUR.sub(lambda found: _COLOURS[found[0]], value)
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    return _NAMED.sub(f"{name}-", value)

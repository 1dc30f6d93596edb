from __future__ import annotations

import re
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest

from nbv.experiment.report.svg import inline_svg, svg_text
from nbv.robot.style import INK, RC, new_figure


@pytest.fixture(scope="module")
def text():
    """A drawing with everything that has a name: markers, clipped lines, hatches and an image."""
    with mpl.rc_context(RC):
        figure = new_figure(2, 2)
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], "o", color="#0072B2")
        axes.bar([0], [1], hatch="//", facecolor="#D55E00", edgecolor=INK)
        axes.imshow(np.eye(3), interpolation="none")
        axes.set_xlabel("a < b & c")
    return svg_text(figure)


def test_every_name_is_the_drawings_own_and_leads_somewhere(text):
    first, second = (ElementTree.fromstring(inline_svg(text, name, "it")) for name in "ab")
    for root, name in ((first, "a"), (second, "b")):
        ids = [one.attrib["id"] for one in root.iter() if "id" in one.attrib]
        assert len(ids) == len(set(ids))
        assert all(one.startswith(f"{name}-") for one in ids)
        values = " ".join(value for one in root.iter() for value in one.attrib.values())
        named = set(re.findall(r"url\(#([^)]+)\)", values))
        named |= {one.attrib["href"][1:] for one in root.iter("use")}
        assert len(named) >= 3
        assert named <= set(ids)


def test_it_is_an_element_that_says_what_it_shows(text):
    root = ElementTree.fromstring(inline_svg(text, "a", "What < it shows"))
    assert root.tag == "svg"
    assert root.attrib["aria-label"] == "What < it shows"
    assert {"viewBox", "width", "role"} <= set(root.attrib)
    assert "a < b & c" in "".join(root.itertext())
    assert not {"metadata", "style"} & {one.tag for one in root.iter()}
    (image,) = root.iter("image")
    assert image.attrib["href"].startswith("data:image/png;base64,")


def test_ink_and_paper_are_the_pages_and_colours_of_methods_stay(text):
    page = inline_svg(text, "a", "it")
    assert "var(--ink)" in page
    assert "var(--page)" in page
    assert {"#0072b2", "#d55e00"} <= set(re.findall(r"#[0-9a-f]{6}", page))
    assert "http" not in page


def test_coordinates_keep_two_decimals(text):
    def points(drawn):
        root = ElementTree.fromstring(drawn)
        paths = (one.attrib["d"] for one in root.iter() if one.tag.endswith("path"))
        return np.array([float(x) for d in paths for x in re.findall(r"-?\d+\.?\d*", d)])

    np.testing.assert_allclose(points(inline_svg(text, "a", "it")), points(text), atol=0.01)

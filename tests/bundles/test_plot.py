"""What the picture of a recommendation says, as its SVG file has it."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from nbv.bundles.plot import draw_recommendation
from nbv.choice.next_view import Move, Recommendation

SVG = "{http://www.w3.org/2000/svg}"
BINS = 60


def recommendation(rotation_deg: float = 90.0, n_frames: int = 1) -> Recommendation:
    rotations = np.arange(BINS) * (360.0 / BINS)
    error = 10.0 - 4.0 * np.cos(np.radians(rotations - rotation_deg))
    error[[-2, -1, 0, 1, 2]] = np.inf
    return Recommendation(
        azimuth_deg=86.1,
        spread_deg=20.0,
        expected_error_deg=12.3,
        moves=(
            Move(rotation_deg=rotation_deg, travel_deg=abs(rotation_deg), expected_error_deg=6.0),
            Move(rotation_deg=-45.0, travel_deg=45.0, expected_error_deg=9.0),
        ),
        belief=np.full(BINS, 1 / BINS),
        error_after_deg=error,
        ood_score=0.5,
        bayes_factor=1.0,
        warnings=(),
        n_views=n_frames,
        crops=n_frames * (np.full((64, 64), 128, np.uint8),),
    )


@pytest.fixture
def drawn(tmp_path: Path):
    """A function that draws an answer, and returns the root of its SVG file."""

    def root_of(answer: Recommendation) -> ElementTree.Element:
        draw_recommendation(answer, tmp_path / "answer.svg", "mug")
        return ElementTree.parse(tmp_path / "answer.svg").getroot()

    return root_of


def texts(root: ElementTree.Element) -> list[str]:
    return ["".join(one.itertext()) for one in root.iter(f"{SVG}text")]


def points(path: ElementTree.Element) -> np.ndarray:
    return np.array(re.findall(r"(-?[\d.]+) (-?[\d.]+)", path.attrib["d"]), dtype=float)


@pytest.mark.parametrize(
    ("n_frames", "titles"),
    [
        (1, ["Network input"]),
        (2, ["Frame 1", "Frame 2"]),
        (6, ["Frame 3 of 6", "Frame 4 of 6", "Frame 5 of 6", "Frame 6 of 6"]),
    ],
)
def test_each_crop_has_the_number_of_its_frame(drawn, n_frames, titles):
    found = texts(drawn(recommendation(n_frames=n_frames)))
    assert [text for text in found if re.match("Frame|Network", text)] == titles


def test_both_circles_say_what_they_show(drawn):
    found = texts(drawn(recommendation(-90.0)))
    assert "Azimuth (camera around mug): 86°" in found
    assert "expected error 12.3°" in found
    assert "radius: √p(azimuth)" in found
    assert "recommended: −90°, 6.0°" in found
    assert " ".join(found).count("0°: the camera now") == 1
    assert {"+90°", "180°", "−90°"} <= set(found)


@pytest.mark.parametrize("rotation_deg", [15.0, 90.0, 180.0, -174.0, -30.0])
def test_the_arrow_goes_the_way_that_the_camera_goes(drawn, rotation_deg):
    root = drawn(recommendation(rotation_deg))
    (axes,) = (one for one in root.iter(f"{SVG}g") if one.attrib.get("id") == "axes_3")
    circle = points(next(axes.iter(f"{SVG}path")))
    (move,) = (one for one in axes.iter(f"{SVG}g") if one.attrib.get("id") == "move")
    line, head = (points(path) for path in move.iter(f"{SVG}path"))
    way = np.vstack([line, head[1]]) - (circle.min(axis=0) + circle.max(axis=0)) / 2
    # In an SVG file y is down.
    angle_deg = np.degrees(np.unwrap(np.arctan2(-way[:, 1], way[:, 0])))
    assert angle_deg[0] == pytest.approx(0.0, abs=0.5)
    # The head's edge is drawn about its corner, and reaches farther by half its width.
    assert angle_deg[-1] == pytest.approx(rotation_deg, abs=2.0)
    assert np.hypot(*way.T) == pytest.approx(np.hypot(*way[0]), rel=0.03)


def test_an_allowed_rotation_without_neighbours_is_seen(drawn):
    def marks(*allowed_deg: int) -> int:
        whole = recommendation()
        error = np.full(BINS, np.inf)
        for rotation_deg in allowed_deg:
            place = rotation_deg * BINS // 360
            error[place] = whole.error_after_deg[place]
        return len(list(drawn(replace(whole, error_after_deg=error)).iter(f"{SVG}use")))

    assert marks(90, 150, 210) == marks(90, 150) + 1


def test_without_a_next_view_there_is_no_circle_of_errors(drawn):
    whole = recommendation(n_frames=4)
    nowhere = np.full(BINS, np.inf)
    root = drawn(replace(whole, moves=(), error_after_deg=nowhere))
    found = " ".join(texts(root))
    assert "Azimuth (camera around mug): 86°" in found
    assert "best" not in found
    assert "camera now" not in found
    assert not any(one.attrib.get("id") == "move" for one in root.iter(f"{SVG}g"))

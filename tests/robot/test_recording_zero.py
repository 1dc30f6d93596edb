"""The zero of recordings, by the handle: `tools/recording_zero.py`, and what the page says."""

from __future__ import annotations

import importlib
import io
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nbv.core.angles import signed_difference_deg
from nbv.robot.masks import window_of
from nbv.robot.synthetic import draw_frame

ROOT = Path(__file__).parents[2]
FRAMES = Path(os.environ.get("NBV_FRAMES", ROOT.parent / "shared/data/frames"))
KEPT = ROOT / "docs/reference/bundles/zero.csv"


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "tools")
        yield importlib.import_module("recording_zero")


def printed(tool, manifest, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["recording_zero.py", str(manifest)])
    tool.main()
    return pd.read_csv(io.StringIO(capsys.readouterr().out))


@pytest.mark.parametrize(
    ("sensor", "offset", "within"),
    [("none", 3.0, 0.5), pytest.param("kinect", -10.0, 1.0, marks=pytest.mark.slow)],
)
def test_the_zero_of_drawn_frames_is_found(
    tool, tmp_path, capsys, monkeypatch, sensor, offset, within
):
    """Of frames that are cut out around the mug, one of which has a wrong azimuth."""
    mug, _, diagonal_m = importlib.import_module("same_shape").the_mug()
    rows = []
    for sequence, ((elevation_deg, distance_m), *_) in tool.VIEWS.items():
        for place, azimuth_deg in enumerate(range(222, 319, 8)):
            seen = draw_frame(
                *(mug, float(azimuth_deg), elevation_deg, distance_m, diagonal_m, place),
                sensor=sensor,
            )
            file = f"{sequence}_{azimuth_deg}.npy"
            np.save(tmp_path / file, seen.depth_m[window_of(seen.mask)[1]])
            rows.append((sequence, file, azimuth_deg - offset + (7.0 if place == 6 else 0.0)))
    table = pd.DataFrame(rows, columns=["sequence", "file", "azimuth_deg"])
    table.insert(0, "object_id", "drawn")
    table.to_csv(tmp_path / "manifest.csv", index=False)
    found = printed(tool, tmp_path / "manifest.csv", capsys, monkeypatch)
    for _, zero_deg in found.groupby(["sequence", "elevation_deg"])["zero_deg"]:
        assert zero_deg.to_numpy() == pytest.approx(offset, abs=within)


def test_the_page_has_the_zeros():
    page = " ".join((ROOT / "docs/reference/bundles/README.md").read_text("utf-8").split())
    zeros = pd.read_csv(KEPT).groupby(["sequence", "elevation_deg"])["zero_deg"].first()
    level, low, high = zeros
    assert f"{level:+.1f}° (level)" in page
    assert f"{low:+.1f}° at 25° and {high:+.1f}° at 33° (from above)".replace("-", "−") in page


def test_the_page_says_where_the_handle_is_farther_back_than_drawn():
    page = " ".join((ROOT / "docs/reference/bundles/README.md").read_text("utf-8").split())
    level = pd.read_csv(KEPT).query("sequence == 1")
    from_camera = signed_difference_deg(270.0, level["azimuth_deg"] + level["zero_deg"])
    behind = level[np.abs(from_camera) > 90].dropna()
    farther = signed_difference_deg(behind["handle_deg"], behind["drawn_handle_deg"])
    farther *= np.sign(from_camera[behind.index])
    numbers = f"{farther.mean():.1f}° on average ({farther.min():.1f} to {farther.max():.1f}°)"
    assert f"In {len(farther)} level frames" in page
    assert numbers in page


@pytest.mark.slow
@pytest.mark.skipif(
    not (FRAMES / "manifest.csv").is_file(), reason="the recordings are not here: NBV_FRAMES"
)
def test_the_frames_have_the_kept_table(tool, capsys, monkeypatch):
    found = printed(tool, FRAMES / "manifest.csv", capsys, monkeypatch)
    pd.testing.assert_frame_equal(found, pd.read_csv(KEPT), atol=0.05)

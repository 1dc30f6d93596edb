"""A rendered mug of the real one's shape: `tools/same_shape.py`, and what the page says of it."""

from __future__ import annotations

import importlib.util
import io
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nbv.data.procedural.mug import handle_reach

ROOT = Path(__file__).parents[2]
FRAMES = Path(os.environ.get("NBV_FRAMES", ROOT.parent / "shared/data/frames"))
KEPT = ROOT / "docs/reference/bundles/same_shape.csv"
NO_HANDLE = "real, no handle"

WITHOUT = "these pixels, hidden handles removed"
LINES = {
    "rendered, true depth": ("true", "rendered"),
    "rendered, noise": ("noisy", "rendered"),
    "rendered, true depth, the real frames' pixels": ("true", "real"),
    "rendered, noise, the real frames' pixels": ("noisy", "real"),
    f"rendered, true depth, {WITHOUT}": ("true", NO_HANDLE),
    f"rendered, noise, {WITHOUT}": ("noisy", NO_HANDLE),
    "real": ("real", "real"),
    "real, with the zero that its handle gives": ("real", "real, zero by the handle"),
}


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("same_shape", ROOT / "tools/same_shape.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_mug_is_as_large_as_was_measured(tool):
    mesh, body, diagonal_m = tool.the_mug()
    across, along, height = diagonal_m * np.ptp(mesh.vertices, axis=0)
    assert across == pytest.approx(2 * tool.RADIUS, abs=1e-4)
    # The thickest part of the handle's outline is half of it beyond the centre line.
    outermost = tool.RADIUS - tool.WALL / 2 + tool.REACH + tool.HALF_THICK
    assert along == pytest.approx(tool.RADIUS + outermost, abs=1e-3)
    assert height == pytest.approx(tool.HEIGHT + tool.WALL / 3, abs=1e-4)
    assert handle_reach(mesh) == pytest.approx(along / across - 1.0, abs=1e-6)
    distance = np.linalg.norm(body.vertices[np.unique(body.faces)][:, :2], axis=1)
    assert diagonal_m * distance.max() == pytest.approx(tool.RADIUS, abs=1e-6)


@pytest.mark.parametrize(("down", "right"), [(0, 0), (5, -3), (-8, 8)])
def test_a_moved_crop_is_brought_back_and_filled_from_its_nearest_pixels(tool, down, right):
    rng = np.random.default_rng(0)
    real = np.zeros((64, 64), dtype=np.uint8)
    real[20:44, 22:40] = rng.integers(100, 200, (24, 18))
    rendered = real.copy()
    # Some pixels on the right are lost, and some are added on the left.
    rendered[30:44, 39] = 0
    rendered[20:26, 21] = 99
    found = tool.with_pixels_of(np.roll(rendered, (down, right), (0, 1)), real)
    np.testing.assert_array_equal(found > 0, real > 0)
    np.testing.assert_array_equal(found[:, 22:39], real[:, 22:39])
    np.testing.assert_array_equal(found[31:44, 39], real[31:44, 38])


@pytest.mark.parametrize("line", LINES)
def test_the_page_has_the_means_of_trainings_and_draws(line):
    errors = pd.read_csv(KEPT).set_index(["depth", "pixels"]).sort_index().loc[LINES[line]]
    errors = errors[errors["elevation_deg"] != 33]
    n_draws = 10 if LINES[line][0] == "noisy" else 1
    cells = []
    for _, rows in errors.groupby("sequence"):
        assert len(rows) == 3 * n_draws
        cells.append("{:.1f} and {:.1f}".format(*rows[["one_view_deg", "two_views_deg"]].mean()))
    page = (ROOT / "docs/bundles.md").read_text(encoding="utf-8").splitlines()
    assert f"| {line} | {' | '.join(cells)} |" in page


@pytest.mark.parametrize("training", [0, 1, 2])
def test_from_above_the_real_mug_errs_as_one_without_a_handle_where_it_shows_none(training):
    errors = pd.read_csv(KEPT).query("training == @training and sequence == 2")
    (real,) = errors.query("depth == 'real' and pixels == 'real'")["one_view_deg"]
    page = " ".join((ROOT / "docs/bundles.md").read_text(encoding="utf-8").split())
    drawn = errors[(errors["depth"] == "noisy") & (errors["pixels"] == NO_HANDLE)]
    for elevation_deg, rows in drawn.groupby("elevation_deg")["one_view_deg"]:
        assert rows.min() <= real <= rows.max()
        if elevation_deg == 25:
            assert f"{rows.min():.1f} to {rows.max():.1f}°" in page


@pytest.mark.slow
@pytest.mark.skipif(
    not (FRAMES / "manifest.csv").is_file(), reason="the recordings are not here: NBV_FRAMES"
)
def test_the_shipped_bundle_has_the_kept_errors(tool, capsys, monkeypatch):
    """On another processor, sums in another order may change the last digit."""
    manifest = str(FRAMES / "manifest.csv")
    monkeypatch.setattr("sys.argv", ["same_shape.py", manifest, "mug"])
    _level, above = tool.read_manifest(manifest)
    monkeypatch.setattr(tool, "read_manifest", lambda _: [above])
    monkeypatch.setattr(tool, "N_DRAWS", 1)
    monkeypatch.setattr(tool, "VIEWS", {above.sequence: tool.VIEWS[above.sequence][:1]})
    tool.main()
    found = pd.read_csv(io.StringIO(capsys.readouterr().out), dtype=str, keep_default_na=False)
    kept = pd.read_csv(KEPT, dtype=str, keep_default_na=False).query("training == '0'")
    keys = ["training", "sequence", "elevation_deg", "depth", "draw", "pixels"]
    both = found.merge(kept, on=keys, suffixes=("", "_kept"))
    assert len(both) == len(found) == 8
    for column in ("one_view_deg", "two_views_deg"):
        errors = both[column].astype(float), both[f"{column}_kept"].astype(float)
        assert errors[0].to_numpy() == pytest.approx(errors[1].to_numpy(), abs=0.15)

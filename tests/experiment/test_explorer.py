import base64
import io
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

import synthetic
from nbv.errors import UserError
from nbv.experiment.explorer import build_explorer, coarse_bins
from nbv.experiment.explorer.data import (
    COLUMNS,
    byte_planes,
    expected_pose,
    hundredths,
    outcomes_of,
    page_table,
    quantised,
    quantised_logs,
    ring_of,
    rows_differenced,
    wrapped,
)
from nbv.experiment.report.figures.views import depth_limits, shade
from nbv.tables.lookup import LookupTable
from reports import explorer_inputs

FOLDS = range(1, synthetic.N_FOLDS + 1)


@pytest.fixture(scope="module")
def inputs(tree):
    images = {"depth": synthetic.depth_files(tree), "objects": synthetic.object_files(tree)}
    return explorer_inputs(tree, **images)


@pytest.fixture(scope="module")
def page(inputs):
    return build_explorer(inputs)


def test_the_page_needs_nothing_but_itself_and_is_the_same_again(page, inputs):
    assert build_explorer(inputs) == page
    assert not re.findall(r"(?:src|href)\s*=\s*[\"'](?!data:)", page)
    assert "http" not in re.sub(r"<script type=\"text/plain\".*?</script>", "", page, flags=re.S)


def test_the_page_has_every_object_of_every_unit(page, evaluations):
    found = re.search(r'<script type="application/json" id="facts">(.*?)</script>', page, re.S)
    units = json.loads(found[1])["units"]
    assert [(unit["category"], unit["elevation"]) for unit in units] == list(synthetic.UNITS)
    for index, unit in enumerate(units):
        of_unit = evaluations[unit["category"], unit["elevation"]]
        folds = of_unit.drop_duplicates("object_id").set_index("object_id")["fold"]
        assert dict(zip(unit["objects"], unit["folds"], strict=True)) == folds.to_dict()
        for place in range(len(unit["objects"])):
            assert f'id="ring-{index}-{place}"' in page


def test_a_run_whose_methods_follow_no_table_is_refused(inputs):
    with pytest.raises(UserError, match="no method of this run follows one"):
        build_explorer(replace(inputs, lookups={}))


@pytest.mark.parametrize("column", ["initial_estimate_deg", "next_estimate_deg"])
def test_methods_that_disagree_about_an_estimate_are_refused(evaluations, column):
    frame = evaluations["mug", 30].copy()
    of_opposite = frame.index[frame["method"] == "opposite"]
    frame.loc[of_opposite[7], column] += 0.001
    with pytest.raises(UserError, match="mug at 30°: opposite has other estimates"):
        outcomes_of(("mug", 30), frame)


def test_outcomes_are_the_rows_of_the_files(evaluations):
    frame = evaluations["mug", 0]
    outcomes = outcomes_of(("mug", 0), frame)
    for method in synthetic.METHODS:
        rows = frame[frame["method"] == method].set_index(["object_id", "initial_deg"])
        order = pd.MultiIndex.from_product([outcomes.object_ids, range(360)])
        rows = rows.loc[order]
        pose = outcomes.pose[method].ravel()
        np.testing.assert_array_equal(pose, np.round(rows["pose_estimate_deg"] * 100) % 36000)
        assert (method in outcomes.rotation) == (method != "single")
        if method in outcomes.rotation:
            np.testing.assert_array_equal(outcomes.rotation[method].ravel(), rows["delta_deg"])
        # What the page works out by itself is next to what the files say: little is left to keep.
        expected = expected_pose(outcomes.estimate, outcomes.rotation.get(method))
        off = np.abs(wrapped(outcomes.pose[method] - expected))
        assert np.mean(off <= 2) > 0.999
        means = rows["error_deg"].groupby(level=0).mean().loc[list(outcomes.object_ids)]
        np.testing.assert_allclose(outcomes.means[method], means, atol=0.005)
        overall = outcomes.overall[method]
        above = rows["error_deg"] > 90
        assert overall["mean"] == pytest.approx(rows["error_deg"].mean(), abs=0.005)
        assert overall["above"] == pytest.approx((rows["error_deg"] * above).mean(), abs=0.005)
        assert overall["share"] == pytest.approx(100 * above.mean(), abs=0.005)


def restored(table):
    """Return a table as the page decodes it."""
    return table.low + table.codes.astype(float) * ((table.high - table.low) / 255)


def test_tables_are_off_by_no_more_than_the_page_says(tree):
    table = LookupTable.load(tree / "lookup/mug/el00/fold1/pose_ambiguity.npz")
    stored = page_table(table)
    weights = np.exp(restored(stored.logs))
    found = weights / weights.sum(axis=1, keepdims=True)
    step = (stored.logs.high - stored.logs.low) / 255
    assert np.exp(step) < 1.085
    # A step of the logarithm, and what it does to the sum.
    assert np.abs(np.log(found / table.estimate_likelihood)).max() < 1.1 * step
    half_step = (table.cost.max() - table.cost.min()) / 510
    assert np.abs(restored(stored.cost) - table.cost).max() <= half_step * 1.0001
    assert stored.unit == "nats"


@given(arrays.arrays(np.int64, st.integers(1, 40), elements=st.integers(-18000, 17999)))
def test_planes_hold_every_difference_of_angles(values):
    planes = np.frombuffer(byte_planes(values), np.uint8).astype(int)
    folded = 256 * planes[: len(values)] + planes[len(values) :]
    back = np.where(folded % 2, -(folded + 1) // 2, folded // 2)
    np.testing.assert_array_equal(back, values)


@given(arrays.arrays(np.uint8, st.tuples(st.integers(1, 8), st.integers(1, 8))))
def test_sums_undo_differences(codes):
    differences = np.frombuffer(rows_differenced(codes), np.uint8).reshape(codes.shape)
    back = differences.cumsum(axis=0, dtype=np.uint8).cumsum(axis=1, dtype=np.uint8)
    np.testing.assert_array_equal(back, codes)


def test_a_level_table_is_kept_as_it_is():
    level = quantised(np.full((3, 3), 5.25))
    assert (restored(level) == 5.25).all()


def test_what_never_occurs_makes_nothing_else_coarser():
    kept = quantised_logs(np.array([[0.0, 0.25, 0.75]]))
    np.testing.assert_allclose(np.exp(restored(kept)[0, 1:]), [0.25, 0.75], rtol=0.05)
    assert np.exp(restored(kept)[0, 0]) < 1e-8


def test_angles_wrap_at_360_degrees():
    assert hundredths(np.array([359.996, 0.004, 12.345])).tolist() == [0, 0, 1234]
    assert wrapped(np.array([18000, -18001, 35999])).tolist() == [-18000, 17999, -1]


@pytest.mark.parametrize(
    ("n_views", "n_bins", "coarse"), [(360, 360, 120), (72, 360, 72), (8, 8, 8)]
)
def test_coarse_bins_lead_from_view_to_view_and_share_centres(n_views, n_bins, coarse):
    assert coarse_bins(n_bins, n_views) == coarse


@pytest.mark.parametrize(
    ("n_views", "side", "n_images"), [(360, 20, 36), (360, 96, 36), (8, 16, 8)]
)
def test_a_ring_holds_the_figures_images(tree, n_views, side, n_images):
    codes = np.load(synthetic.depth_files(tree)["mug", 0], mmap_mode="r")[0]
    codes = np.repeat(np.repeat(codes, -(-side // 20), axis=1), -(-side // 20), axis=2)
    codes = codes[:: 360 // n_views, :side, :side]
    ring = ring_of(codes)
    assert (ring.n_images, ring.side) == (n_images, min(side, 64))
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(ring.data))).convert("L"), float)
    shown = codes[:: n_views // n_images]
    last = 255 * shade(shown, depth_limits(shown))[-1]
    row, column = divmod(n_images - 1, COLUMNS)
    tile = picture[row * ring.side :, column * ring.side :][: ring.side, : ring.side]
    if side <= 64:
        assert np.abs(tile - last).mean() < 20


def test_texts_are_deflated_base64(page):
    text = re.search(r'id="unit-0">([A-Za-z0-9+/=]+)<', page)[1]
    n = 9 * 360
    assert len(zlib.decompress(base64.b64decode(text))) == 2 * n * (1 + 1 + 2 + 2 + 2)

"""Tables and bundles that an earlier version saved load, and answer as before."""

from pathlib import Path

import numpy as np
import pytest

import nbv

KEPT = Path(__file__).parent


def test_a_lookup_table_recommends_what_it_did():
    table = nbv.LookupTable.load(KEPT / "lookup.npz")
    assert table.recommend([0, 100, 200]).tolist() == [110, 90, 340]
    assert table.cost[10].min() == pytest.approx(3.582209)


def test_distributions_recommend_what_they_did():
    peak = np.exp(3 * np.cos(np.radians(np.arange(0, 360, 15) - 100)))
    answer = nbv.DistributionTable.load(KEPT / "distributions.npz").recommend(peak / peak.sum())
    assert answer.azimuth_deg == pytest.approx(100, abs=0.001)
    assert answer.expected_error_deg == pytest.approx(4.60597, rel=1e-4)
    assert answer.move.rotation_deg == 45
    assert answer.move.expected_error_deg == pytest.approx(3.40502, rel=1e-4)


def test_orientations_rank_as_they_did():
    table = nbv.OrientationTable.load(KEPT / "orientations.npz")
    answer = table.recommend([nbv.PoseEstimate(np.eye(3))], 20, object_id="1")
    assert answer.expected_error_deg == pytest.approx(113.49788, rel=1e-5)
    assert answer.holds_where is None
    best = answer.moves[0]
    assert (best.index, best.expected_error_deg) == (7, pytest.approx(37.72614, rel=1e-5))


def test_the_shipped_bundle_expects_what_it_did():
    frame = nbv.example_frame()
    answer = nbv.Recommender.load("mug").recommend(frame.depth_m, intrinsics=frame.intrinsics)
    assert answer.expected_error_deg == pytest.approx(33.9, abs=0.05)
    assert answer.move.rotation_deg == 180

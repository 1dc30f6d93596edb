from __future__ import annotations

import numpy as np
import pytest

from nbv.angles import circular_distance_deg
from nbv.calibration.estimates import Estimates
from nbv.errors import UserError
from nbv.experiments.two_views import COLUMNS, check_method, evaluate_method
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.lookup import build_lookup
from nbv.recommendation.policies import needs_lookup

RNG = np.random.default_rng(0)
SETTINGS = {"reading": "given_estimate", "spread": "entropy"}


def estimates(n_objects: int = 4, n_views: int = 36, seed: int = 0) -> Estimates:
    rng = np.random.default_rng(seed)
    truth = np.arange(n_views) * 360.0 / n_views
    answer = (truth + rng.normal(0, 12, (n_objects, n_views))) % 360
    names = tuple(f"{index:03d}" for index in range(n_objects))
    return Estimates(names, np.round(answer, 4), np.ones_like(answer))


def method(rotation: str) -> dict[str, str]:
    return {"rotation": rotation, "fusion": "average"}


def test_one_view_alone_is_the_estimate_itself():
    test = estimates()
    rows = evaluate_method(method("none"), test)
    assert tuple(rows.columns) == COLUMNS
    assert rows["delta_deg"].isna().all()
    assert rows["next_estimate_deg"].isna().all()
    np.testing.assert_allclose(rows["pose_estimate_deg"], test.estimate_deg.ravel())


def test_rows_follow_objects_and_then_views():
    test = estimates()
    rows = evaluate_method(method("opposite"), test, RNG)
    assert rows["object_id"].tolist() == [name for name in test.object_ids for _ in range(36)]
    assert rows["initial_deg"].tolist() == [*range(0, 360, 10)] * 4


def test_opposite_makes_the_same_error_from_either_side():
    rows = evaluate_method(method("opposite"), estimates(), RNG)
    error = rows["error_deg"].to_numpy().reshape(4, 36)
    np.testing.assert_allclose(error, np.roll(error, 18, axis=1), atol=2e-4)


def test_random_views_are_all_others_and_equally_likely():
    test = estimates(n_objects=200)
    rows = evaluate_method(method("random"), test, np.random.default_rng(1))
    counts = rows["delta_deg"].value_counts()
    assert sorted(counts.index) == list(range(10, 360, 10))
    expected = len(rows) / 35
    chi_squared = ((counts - expected) ** 2 / expected).sum()
    assert chi_squared < 66  # the 99.9th percentile for 34 degrees of freedom


def test_random_views_are_the_generators():
    test = estimates()
    first, again = (
        evaluate_method(method("random"), test, np.random.default_rng(7)) for _ in range(2)
    )
    assert first.equals(again)


def test_recommended_rotations_come_from_the_table_and_errors_from_what_is_seen():
    test = estimates()
    lookup = build_lookup(
        gather_evidence(
            estimates(seed=5).estimate_deg,
            SETTINGS,
            bandwidth_deg=15,
            pseudo_observations=5,
            n_bins=36,
        ),
        "entropy",
    )
    rows = evaluate_method(method("entropy"), test, lookup=lookup)
    for row in rows.itertuples():
        one = test.object_ids.index(row.object_id)
        delta = lookup.recommended_delta_deg[round(row.initial_estimate_deg / 10) % 36]
        assert row.delta_deg == delta
        second = test.estimate_deg[one, (row.initial_deg + delta) // 10 % 36]
        assert row.next_estimate_deg == second
        total = np.exp(1j * np.radians(row.initial_estimate_deg))
        total += np.exp(1j * np.radians(second - delta))
        pose = np.degrees(np.angle(total))
        assert circular_distance_deg(row.pose_estimate_deg, pose) < 1e-3
        assert row.error_deg == pytest.approx(
            float(circular_distance_deg(pose, row.initial_deg)), abs=1e-3
        )


def test_what_needs_a_lookup_table():
    assert needs_lookup("entropy")
    assert not needs_lookup("none")
    assert not needs_lookup("opposite")
    with pytest.raises(UserError, match="did you mean 'opposite'"):
        needs_lookup("oposite")
    with pytest.raises(UserError, match=r"methods\.x\.fusion=averge is unknown: did you mean"):
        check_method("x", {"rotation": "none", "fusion": "averge"})
    with pytest.raises(ValueError, match="needs a lookup table"):
        evaluate_method(method("entropy"), estimates())

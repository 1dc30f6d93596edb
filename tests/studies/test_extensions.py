from __future__ import annotations

import numpy as np
import pytest
from studies.extensions import evaluate_extensions
from studies.selection import select_methods

from made_estimates import EXTENSIONS, FEW_DENSITIES, objects
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.evidence import gather_evidence
from nbv.core.circle.fusion import FUSIONS
from nbv.core.circle.lookup import build_lookup
from nbv.experiment.results import COLUMNS, evaluate_method

RNG = np.random.default_rng(0)
SETTINGS = {"pose_likelihood": "given_estimate", "spread": "entropy"}


def estimates(n_objects: int = 4, n_views: int = 36, seed: int = 0) -> Estimates:
    rng = np.random.default_rng(seed)
    truth = np.arange(n_views) * 360.0 / n_views
    answer = (truth + rng.normal(0, 12, (n_objects, n_views))) % 360
    names = tuple(f"{index:03d}" for index in range(n_objects))
    return Estimates(names, np.round(answer, 4))


def method(policy: str) -> dict[str, str]:
    return {"policy": policy, "fusion": "average"}


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
        "pose_ambiguity",
    )
    rows = evaluate_method(method("pose_ambiguity"), test, lookup=lookup)
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


@pytest.fixture(scope="module")
def evaluated():
    generators = {name: np.random.default_rng(0) for name in EXTENSIONS}
    return evaluate_extensions(
        objects(6, 0), objects(5, 1), EXTENSIONS, FEW_DENSITIES, generators.__getitem__
    )


def test_rows_of_extensions_agree_with_the_estimates_they_came_from(evaluated):
    test, selected = objects(5, 1), select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES)
    assert list(evaluated.frames) == list(EXTENSIONS)
    for name, frame in evaluated.frames.items():
        for row in frame.iloc[[3, 400, 1200]].itertuples():
            which = test.object_ids.index(row.object_id)
            assert row.initial_estimate_deg == test.estimate_deg[which, row.initial_deg]
            seen = test.estimate_deg[which, (row.initial_deg + row.delta_deg) % 360]
            assert row.next_estimate_deg == seen
            fused = FUSIONS[selected[name].fusion](
                row.initial_estimate_deg, seen, row.delta_deg, selected[name].evidence
            )
            assert circular_distance_deg(fused, row.pose_estimate_deg) < 0.05


def test_extensions_come_with_their_choices_tables_and_travel(evaluated):
    assert evaluated.choices["method"].tolist() == list(EXTENSIONS)
    with_tables = {"gain_posterior", "error_average", "selected"}
    assert set(evaluated.lookups) == with_tables
    assert with_tables < set(evaluated.travel["method"])


N_CLASSES = 36
PRODUCTS = {
    "gain_product": {"policy": "information_gain", "fusion": "product"},
    "opposite_product": {"policy": "opposite", "fusion": "product"},
    "error_product": {"policy": "expected_error", "fusion": "product"},
    "random_product": {"policy": "random", "fusion": "product"},
}


def hidden_handle(n_objects: int, seed: int) -> Posteriors:
    """Distributions that know the azimuth, except within 50 degrees of 90, where all are alike."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    centres = np.arange(N_CLASSES) * 360 / N_CLASSES
    answer = truth + rng.normal(0, 3, (n_objects, 360))
    seen = np.exp((np.cos(np.radians(centres - answer[..., None])) - 1) / np.radians(8) ** 2)
    hidden = circular_distance_deg(truth, 90) < 50
    blind = np.where(circular_distance_deg(centres, 90) < 50, 1.0, 1e-6)
    p = np.where(hidden[:, None], blind, seen) + 1e-9
    names = tuple(f"{seed}-{i}" for i in range(n_objects))
    return Posteriors(names, np.log(p / p.sum(axis=-1, keepdims=True)), 1.0)


def mean_directions(posteriors: Posteriors) -> Estimates:
    centres = np.radians(np.arange(N_CLASSES) * 360 / N_CLASSES)
    mean = np.exp(posteriors.log_posterior) @ np.exp(1j * centres)
    return Estimates(posteriors.object_ids, np.degrees(np.angle(mean)) % 360)


def test_by_its_images_distributions_a_hidden_handle_is_sought_and_found():
    test, calibration = hidden_handle(3, 0), hidden_handle(5, 1)
    estimates = mean_directions(test)
    frames = evaluate_extensions(
        mean_directions(calibration),
        estimates,
        PRODUCTS,
        FEW_DENSITIES | {"affinity": {"power": 16, "pseudo_observations": 90}},
        lambda name: np.random.default_rng(0),
        calibration,
        test,
    ).frames
    hidden = circular_distance_deg(frames["gain_product"]["initial_deg"], 90) < 50
    for frame in frames.values():
        assert tuple(frame.columns) == COLUMNS
        views = (frame["initial_deg"] + frame["delta_deg"]) % 360
        expected = estimates.estimate_deg.reshape(3, 360)
        rows = np.repeat(np.arange(3), 360)
        np.testing.assert_allclose(frame["next_estimate_deg"], expected[rows, views])
    assert (frames["opposite_product"]["delta_deg"] == 180).all()
    # The product is exact for whole classes.
    assert set(frames["random_product"]["delta_deg"]) == set(range(10, 360, 10))
    assert circular_distance_deg(estimates.estimate_deg, np.arange(360)).ravel()[hidden].mean() > 20
    for name in ("gain_product", "error_product"):
        assert frames[name]["error_deg"][hidden].mean() < 5

from __future__ import annotations

import numpy as np
import pytest

from nbv.errors import UserError
from nbv.recommendation import lookup
from nbv.recommendation.density_selection import choose_densities, chosen_lookup
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.fusion import two_view_error_deg

SETTINGS = {"reading": "given_estimate", "spread": "entropy", "n_parts": 5}


def build_lookup(estimate_deg, criterion, settings, **density):
    return lookup.build_lookup(gather_evidence(estimate_deg, settings, **density), criterion)


def choose_density(estimate_deg, criterion, settings, **grid):
    method = {"rotation": criterion, "fusion": "average"}
    return choose_densities(estimate_deg, {criterion: method}, settings | grid)[criterion]


def hidden_range_estimates(n_objects: int, seed: int = 0) -> np.ndarray:
    """Estimates of objects whose azimuth cannot be told within 45 degrees of 90."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    hidden = np.abs(truth - 90) < 45
    estimate = truth + rng.normal(0, 4, (n_objects, 360))
    estimate[:, hidden] = 90 + rng.normal(0, 10, (n_objects, hidden.sum()))
    return estimate % 360


def test_ties_go_to_the_smallest_travel_and_then_to_the_smaller_delta():
    flat = np.zeros((2, 8), dtype=np.float32)
    assert lookup.least_ambiguous_delta(flat).tolist() == [0, 0]
    flat[:, 0] = 1
    assert lookup.least_ambiguous_delta(flat).tolist() == [45, 45]  # not 315
    flat[0, 1] = 1
    assert lookup.least_ambiguous_delta(flat).tolist() == [315, 45]


def test_a_stored_table_comes_back_whole(tmp_path):
    table = build_lookup(
        hidden_range_estimates(4),
        "entropy",
        SETTINGS,
        bandwidth_deg=8,
        pseudo_observations=10,
        n_bins=36,
    )
    lookup.save_lookup(tmp_path / "entropy.npz", table)
    read = lookup.load_lookup(tmp_path / "entropy.npz")
    for name, value in vars(table).items():
        np.testing.assert_array_equal(getattr(read, name), value)
    assert read.ambiguity.dtype == np.float32


def test_recommendations_are_read_at_the_nearest_bin():
    table = build_lookup(
        hidden_range_estimates(4), "entropy", SETTINGS, bandwidth_deg=8, pseudo_observations=10
    )
    assert table.recommend([359.6, 0.2, 89.5]).tolist() == [
        table.recommended_delta_deg[k] for k in (0, 0, 90)
    ]


def test_an_unknown_criterion():
    with pytest.raises(UserError, match="did you mean 'entropy'"):
        build_lookup(np.zeros((1, 360)), "entrpy", SETTINGS, bandwidth_deg=1, pseudo_observations=1)


def test_two_view_error_is_that_of_a_plain_loop():
    rng = np.random.default_rng(1)
    estimate = rng.uniform(0, 360, (3, 36))
    delta = rng.integers(0, 36, (3, 36)) * 10
    expected = np.empty((3, 36))
    for o in range(3):
        for v in range(36):
            second = estimate[o, (v + delta[o, v] // 10) % 36] - delta[o, v]
            total = np.exp(1j * np.radians(estimate[o, v])) + np.exp(1j * np.radians(second))
            error = np.degrees(np.angle(total * np.exp(-1j * np.radians(10 * v))))
            expected[o, v] = abs(error)
    np.testing.assert_allclose(two_view_error_deg(estimate, delta), expected, atol=1e-6)


def test_the_chosen_density_decides_best_on_objects_it_has_not_seen():
    estimate = hidden_range_estimates(10)
    grid = {"bandwidths_deg": [2.0, 8.0, 16.0], "pseudo_observations": [1.0, 30.0]}
    choice = choose_density(estimate, "entropy", SETTINGS, **grid)
    assert len(choice.candidate_error_deg) == 6
    chosen = choice.candidate_error_deg[choice.bandwidth_deg, choice.pseudo_observations]
    assert chosen == min(choice.candidate_error_deg.values())
    # One candidate's cross-validated error, recomputed by hand.
    total = 0.0
    for part in range(5):
        held_out = np.arange(10) % 5 == part
        table = build_lookup(
            estimate[~held_out],
            "entropy",
            SETTINGS,
            bandwidth_deg=8.0,
            pseudo_observations=30.0,
            n_bins=120,
        )
        error = two_view_error_deg(estimate[held_out], table.recommend(estimate[held_out]))
        total += error.sum()
    assert choice.candidate_error_deg[8.0, 30.0] == pytest.approx(total / estimate.size)


def test_coarse_tables_decide_like_fine_ones():
    """What the cross-validation rests on when it compares tables of 120 bins."""
    estimate, unseen = hidden_range_estimates(8), hidden_range_estimates(6, seed=9)
    errors = [
        two_view_error_deg(
            unseen,
            build_lookup(
                estimate, "entropy", SETTINGS, bandwidth_deg=8, pseudo_observations=30, n_bins=n
            ).recommend(unseen),
        ).mean()
        for n in (120, 360)
    ]
    assert errors[0] == pytest.approx(errors[1], rel=0.05)


def test_recommending_beats_staying_where_the_handle_is_hidden():
    table = chosen_lookup(
        hidden_range_estimates(10),
        "entropy",
        SETTINGS
        | {"bandwidths_deg": [6.0, 12.0], "pseudo_observations": [10.0, 30.0], "n_parts": 5},
    )
    unseen = hidden_range_estimates(10, seed=5)
    recommended = two_view_error_deg(unseen, table.recommend(unseen))
    stayed = two_view_error_deg(unseen, np.zeros(unseen.shape, dtype=np.int64))
    assert recommended[:, 60:120].mean() < 0.7 * stayed[:, 60:120].mean()


def test_one_candidate_or_one_object_needs_no_choice():
    one = choose_density(
        hidden_range_estimates(3), "entropy", SETTINGS, bandwidths_deg=[7], pseudo_observations=[9]
    )
    assert (one.bandwidth_deg, one.pseudo_observations) == (7, 9)
    alone = choose_density(
        hidden_range_estimates(1),
        "entropy",
        SETTINGS,
        bandwidths_deg=[7, 12],
        pseudo_observations=[9, 3],
    )
    assert (alone.bandwidth_deg, alone.pseudo_observations) == (12, 9)

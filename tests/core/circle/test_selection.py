"""Which density decides best, and which is likeliest."""

import numpy as np
import pytest

from made_estimates import FEW_DENSITIES, SETTINGS, evidence_of, hidden_range_estimates, objects
from nbv.core.circle.lookup import build_lookup
from nbv.core.circle.policies import HeldOutViews, take_second_views
from nbv.core.circle.selection import choose_densities, chosen_lookup, most_likely_density
from nbv.errors import UserError


def choose_density(estimate_deg, **grid):
    methods = {"paper": {"policy": "pose_ambiguity", "fusion": "average"}}
    return choose_densities(estimate_deg, methods, SETTINGS | {"n_parts": 5} | grid)["paper"]


def two_view_error_deg(estimate_deg, delta_deg):
    return take_second_views(delta_deg, "average", HeldOutViews(estimate_deg)).error_deg


def test_the_chosen_density_decides_best_on_objects_it_has_not_seen():
    estimate = hidden_range_estimates(10)
    grid = {"bandwidths_deg": [2.0, 8.0, 16.0], "pseudo_observations": [1.0, 30.0]}
    choice = choose_density(estimate, **grid)
    assert len(choice.candidate_error_deg) == 6
    chosen = choice.candidate_error_deg[choice.bandwidth_deg, choice.pseudo_observations]
    assert chosen == min(choice.candidate_error_deg.values())
    # One candidate's cross-validated error, recomputed by hand.
    total = 0.0
    for part in range(5):
        held_out = np.arange(10) % 5 == part
        table = build_lookup(evidence_of(estimate[~held_out], 8.0, 30.0, 120), "pose_ambiguity")
        error = two_view_error_deg(estimate[held_out], table.recommend(estimate[held_out]))
        total += error.sum()
    assert choice.candidate_error_deg[8.0, 30.0] == pytest.approx(total / estimate.size)


def test_coarse_tables_decide_like_fine_ones():
    """What the cross-validation rests on when it compares tables of 120 bins."""
    estimate, unseen = hidden_range_estimates(8), hidden_range_estimates(6, seed=9)
    errors = [
        two_view_error_deg(
            unseen,
            build_lookup(evidence_of(estimate, 8, 30, n), "pose_ambiguity").recommend(unseen),
        ).mean()
        for n in (120, 360)
    ]
    assert errors[0] == pytest.approx(errors[1], rel=0.05)


def test_recommending_beats_staying_where_the_handle_is_hidden():
    grid = {"bandwidths_deg": [6.0, 12.0], "pseudo_observations": [10.0, 30.0], "n_parts": 5}
    table = chosen_lookup(hidden_range_estimates(10), "pose_ambiguity", SETTINGS | grid)
    unseen = hidden_range_estimates(10, seed=5)
    recommended = two_view_error_deg(unseen, table.recommend(unseen))
    stayed = two_view_error_deg(unseen, np.zeros(unseen.shape, dtype=np.int64))
    assert recommended[:, 60:120].mean() < 0.7 * stayed[:, 60:120].mean()


def test_one_candidate_or_one_object_needs_no_choice():
    one = choose_density(hidden_range_estimates(3), bandwidths_deg=[7], pseudo_observations=[9])
    assert (one.bandwidth_deg, one.pseudo_observations) == (7, 9)
    alone = choose_density(
        hidden_range_estimates(1), bandwidths_deg=[7, 12], pseudo_observations=[9, 3]
    )
    assert (alone.bandwidth_deg, alone.pseudo_observations) == (12, 9)


def test_densities_of_several_methods_are_chosen_as_each_would_be_alone():
    grid = {"bandwidths_deg": [6, 12], "pseudo_observations": [3, 30], "n_parts": 3}
    methods = {
        "a": {"policy": "information_gain", "fusion": "posterior"},
        "b": {"policy": "random", "fusion": "posterior"},
        "c": {"policy": "pose_ambiguity", "fusion": "average"},
    }
    calibration, settings = objects(5, 0).estimate_deg, SETTINGS | grid
    together = choose_densities(calibration, methods, settings, n_bins=60)
    for name, method in methods.items():
        alone = choose_densities(calibration, {name: method}, settings, n_bins=60)
        assert alone[name] == together[name]
        assert together[name].error_deg == min(together[name].candidate_error_deg.values())


def test_the_most_likely_density_is_found_by_trying_all():
    calibration = objects(4, 0).estimate_deg
    grid = FEW_DENSITIES | {"bandwidths_deg": [3, 12], "pseudo_observations": [1, 100]}
    choice = most_likely_density(calibration, grid, n_bins=60)
    totals = {}
    for bandwidth in (3, 12):
        for alpha in (1, 100):
            total = 0.0
            for part in range(2):
                others = calibration[np.arange(4) % 2 != part]
                evidence = evidence_of(others, bandwidth, alpha, 60)
                for row in calibration[np.arange(4) % 2 == part]:
                    for view, estimate in enumerate(row):
                        e, g = (int(x / 6 + 0.5) % 60 for x in (estimate, view))
                        total += np.log(evidence.conditionals.viewpoint[e, g])
            totals[bandwidth, alpha] = total
    best = max(totals, key=totals.__getitem__)
    assert (choice.bandwidth_deg, choice.pseudo_observations) == best


def test_an_error_that_is_not_a_number_is_never_the_least():
    estimate = hidden_range_estimates(6)
    estimate[2, 5] = np.nan
    grid = {"bandwidths_deg": [8.0, 16.0], "pseudo_observations": [10.0]}
    methods = {"opposite": {"policy": "opposite", "fusion": "average"}}
    with np.errstate(invalid="ignore"), pytest.raises(UserError, match="is nan: the estimates"):
        choose_densities(estimate, methods, SETTINGS | {"n_parts": 5} | grid)
    with np.errstate(invalid="ignore"), pytest.raises(UserError, match="not a finite number"):
        choose_density(estimate, **grid)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -1.0])
@pytest.mark.parametrize("key", ["bandwidths_deg", "pseudo_observations"])
def test_a_candidate_that_is_not_finite_makes_no_density(key, wrong):
    """It made uniform rows without a word, and they could win."""
    grid = {"bandwidths_deg": [8.0], "pseudo_observations": [10.0]} | {key: [8.0, wrong]}
    with pytest.raises(ValueError, match="must be 0 or more and finite"):
        choose_density(hidden_range_estimates(6), **grid)

"""Plans for several views, and which one an image leads to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.simulation import (
    DistributionViews,
    evenly_spaced_travel_deg,
    follow,
    recommended_next,
)
from tests.core.made import direction_by_loops, product_by_loops
from tests.core.test_errors_given_distributions import (
    N_BINS,
    N_VIEWS,
    distributions,
    evidence_of,
)

from nbv.core.angles import circular_distance_deg
from nbv.core.belief import Belief
from nbv.core.criteria import CRITERIA, affinity
from nbv.core.plans import (
    Plans,
    at_spacing,
    choose_plan,
    excess_of_plans,
    plans_of,
    spaced_errors_deg,
    spacing_bins,
    step_by_step,
    step_by_step_errors_deg,
)

CAUTIOUS = {"caution": 2.0}


@given(st.integers(2, 8), st.sampled_from([36, 120]), st.floats(0, 45))
def test_no_spacing_travels_farther_than_even_spacing_or_is_too_narrow(n, n_bins, apart_deg):
    found = spacing_bins(n, n_bins, apart_deg)
    assert found[0] == n_bins // n
    assert np.abs(found).max() == found[0]
    narrow = np.abs(found) * 360 / n_bins < apart_deg
    assert (np.abs(found[narrow]) == found[0]).all()
    assert sorted(found) == sorted(-found)
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("n_views", [2, 3, 4])
def test_errors_are_those_of_multiplying_the_views_one_by_one(n_views):
    views, spacings = distributions(0)[:, ::2], np.array([3, -2, 1])
    found = spaced_errors_deg(views, n_views, spacings)
    assert found.shape == (3, 3, N_BINS)
    for i, o, start in np.ndindex(found.shape):
        rotations = spacings[i] * np.arange(n_views)
        product = product_by_loops(views[o, (start + rotations) % N_BINS], rotations)
        expected = circular_distance_deg(direction_by_loops(product), start * 360 / N_BINS)
        assert found[i, o, start] == pytest.approx(float(expected), abs=0.01)


def first_views(seed, evidence):
    return Belief(distributions(seed).reshape(-1, N_BINS)[:7].astype(np.float32), evidence)


def test_without_caution_two_views_cost_what_the_expected_error_says():
    evidence = evidence_of(distributions(0), caution=0.0)
    belief, spacings = first_views(1, evidence), spacing_bins(2, N_BINS, 0.0)
    cost = CRITERIA["expected_error"](belief, evidence, "product")
    plans = plans_of(evidence, 2, 0.0)
    assert plans.spacing_deg.tolist() == (spacings * 360 // N_BINS).tolist()
    excess = excess_of_plans(belief, evidence, plans.errors_deg, plans.caution)
    expected = cost[:, spacings] - cost[:, spacings[:1]]
    np.testing.assert_allclose(excess, expected, atol=2e-3)


def test_caution_adds_standard_errors_over_objects():
    evidence = evidence_of(distributions(0, n_objects=5), **CAUTIOUS)
    belief, spacings = first_views(1, evidence), spacing_bins(3, N_BINS, 0.0)
    views = evidence.distributions[:, :: N_VIEWS // N_BINS]
    errors = spaced_errors_deg(views, 3, spacings)
    weights = 360 / N_BINS * affinity(belief.probabilities, views.reshape(-1, N_BINS)) ** 4
    plain, cautious = (excess_of_plans(belief, evidence, errors, c) for c in (0.0, 2.0))
    for row, i in np.ndindex(plain.shape):
        difference = errors[i] - errors[0]
        counts, sums = np.empty(5), np.empty(5)
        for o, own in enumerate(weights[row].reshape(5, N_BINS)):
            counts[o] = own.sum() + 1
            sums[o] = own @ difference[o] + difference[o].mean()
        mean = sums.sum() / counts.sum()
        left = sums - mean * counts
        error = np.sqrt(np.sum(left**2) * 5 / 4) / counts.sum()
        assert plain[row, i] == pytest.approx(mean, rel=1e-3, abs=1e-3)
        assert cautious[row, i] == pytest.approx(mean + 2 * error, rel=1e-3, abs=1e-3)
    assert (cautious[:, 0] == 0).all()


def test_one_calibration_object_moves_nothing_from_even_spacing():
    evidence = evidence_of(distributions(0, n_objects=1), **CAUTIOUS)
    plans = plans_of(evidence, 3, 15.0)
    assert (choose_plan(first_views(1, evidence), evidence, plans) == 0).all()
    assert plans.spacing_deg[0] == 120


def test_step_by_step_is_a_plan_of_three_views_and_more():
    evidence = evidence_of(distributions(0, n_objects=6), **CAUTIOUS)
    for n_views in (3, 4):
        by_gain = step_by_step_errors_deg(evidence, n_views, 15.0)
        plans = plans_of(evidence, n_views, 15.0)
        assert len(plans.errors_deg) == len(plans.spacing_deg) + 1
        np.testing.assert_array_equal(plans.errors_deg[-1], by_gain)
    assert len(plans_of(evidence, 2, 15.0).errors_deg) == N_BINS


@pytest.mark.parametrize("n_views", [2, 3, 4, 5])
def test_step_by_step_travels_no_farther_than_even_spacing_and_else_as_it_likes(n_views):
    evidence = evidence_of(distributions(0, n_objects=6))
    seen, rng = DistributionViews(distributions(3), evidence), np.random.default_rng(0)
    budget_deg = evenly_spaced_travel_deg(n_views)
    for apart_deg in (0.0, 15.0, 30.0):
        views = {
            limit: follow(
                recommended_next("information_gain", evidence, apart_deg, limit),
                seen,
                n_views=n_views,
                start_every_deg=15,
                rng=rng,
            )
            for limit in (n_views, None)
        }
        assert views[n_views][1, :, :, -1].max() <= budget_deg
        free = (views[None][1, :, :, 1:-1].max(axis=-1, initial=0) <= budget_deg - 30 * n_views) & (
            views[None][1, :, :, -1] <= budget_deg
        )
        np.testing.assert_array_equal(views[n_views][:, free], views[None][:, free])


def test_the_views_of_a_part_are_chosen_with_the_evidence_of_the_others():
    """Two objects of five parts: each is chosen for by the other."""
    views = distributions(5, n_objects=2)
    found = step_by_step_errors_deg(evidence_of(views), 3, 0.0)
    assert found.shape == (2, N_BINS)
    for one in (0, 1):
        known = evidence_of(views[[1 - one]])
        seen = DistributionViews(views[[one]], known)
        policy, rng = step_by_step(known, 0.0, 3), np.random.default_rng(1)
        reached = follow(policy, seen, n_views=3, start_every_deg=30, rng=rng)
        np.testing.assert_allclose(found[one], reached[0, 0, :, -1], atol=1e-4)


def test_a_plan_that_is_surely_better_for_images_alike_is_taken_for_those():
    """Even spacing errs by 10 degrees, the next plan by 1 from every second view and 20 else."""
    views = distributions(7, n_objects=6)
    evidence = evidence_of(views, power=200.0, pseudo_observations=1e-3, **CAUTIOUS)
    errors = np.full((2, 6, N_BINS), 10.0, dtype=np.float32)
    errors[1, :, ::2], errors[1, :, 1::2] = 1.0, 20.0
    rows = views[:, ::2].reshape(-1, N_BINS).astype(np.float32)
    plans = Plans(np.array([120]), errors, 0.0)
    found = choose_plan(Belief(rows, evidence), evidence, plans).reshape(6, N_BINS)
    assert (found == (np.arange(N_BINS) % 2 == 0)).mean() > 0.9


def test_every_view_follows_at_its_step():
    taken = np.zeros((2, 1), dtype=np.int64)
    policy, rng = at_spacing(np.array([90, -60])), np.random.default_rng(0)
    belief = first_views(2, evidence_of(distributions(0)))
    for _ in range(3):
        taken = np.column_stack([taken, policy(belief, taken, rng)])
    assert taken.tolist() == [[0, 90, 180, 270], [0, 300, 240, 180]]


def test_plans_need_distributions_and_a_first_view_of_the_same_estimator():
    evidence = evidence_of(distributions(0))
    errors = np.zeros((2, 3, N_BINS), dtype=np.float32)
    other = first_views(1, evidence_of(distributions(0)))
    with pytest.raises(ValueError, match="one first view by the same estimator"):
        excess_of_plans(other, evidence, errors, 0.0)
    blind = replace(evidence, distributions=None, estimate_deg=np.zeros((3, N_VIEWS)))
    with pytest.raises(ValueError, match="plans need evidence of distributions"):
        excess_of_plans(first_views(1, blind), blind, errors, 0.0)

"""Views at equal steps, and how far apart they are best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.recommendation.test_errors_given_distributions import (
    N_BINS,
    N_VIEWS,
    distributions,
    evidence_of,
)

from nbv.angles import circular_distance_deg
from nbv.recommendation.belief import Belief
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.criteria.expected_error import affinity
from nbv.recommendation.fusion import rotation_errors_deg
from nbv.recommendation.spacing import (
    excess_of_spacings,
    spaced_errors_deg,
    spaced_next,
    spacing_bins,
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
    unit = np.exp(2j * np.pi * np.arange(N_BINS) / N_BINS)
    for place, one, start in np.ndindex(found.shape):
        total = np.ones(N_BINS)
        for view in range(n_views):
            turn = view * spacings[place]
            total = total * np.roll(views[one, (start + turn) % N_BINS], -turn)
        pose_deg = np.degrees(np.angle(total @ unit))
        expected = circular_distance_deg(pose_deg, start * 360 / N_BINS)
        assert found[place, one, start] == pytest.approx(float(expected), abs=0.01)


def test_two_views_have_the_errors_of_the_product_after_each_rotation():
    views = distributions(1)[:, ::2]
    spacings = np.arange(N_BINS)
    pairs = rotation_errors_deg(views, evidence_of(distributions(1)), "product")
    np.testing.assert_allclose(spaced_errors_deg(views, 2, spacings), pairs, atol=0.02)


def first_views(seed, evidence):
    return Belief(distributions(seed).reshape(-1, N_BINS)[:7].astype(np.float32), evidence)


def test_without_caution_two_views_cost_what_the_expected_error_says():
    evidence = evidence_of(distributions(0), caution=0.0)
    belief, spacings = first_views(1, evidence), spacing_bins(2, N_BINS, 0.0)
    cost = CRITERIA["expected_error"](belief, evidence, "product")
    excess = excess_of_spacings(belief, evidence, 2, spacings, 0.0)
    expected = cost[:, spacings] - cost[:, spacings[:1]]
    np.testing.assert_allclose(excess, expected, atol=2e-3)


def test_caution_adds_standard_errors_over_objects():
    evidence = evidence_of(distributions(0, n_objects=5), **CAUTIOUS)
    belief, spacings = first_views(1, evidence), spacing_bins(3, N_BINS, 0.0)
    views = evidence.distributions[:, :: N_VIEWS // N_BINS]
    errors = spaced_errors_deg(views, 3, spacings)
    weights = 2 * affinity(belief.probabilities, views.reshape(-1, N_BINS)) ** 4
    plain, cautious = (excess_of_spacings(belief, evidence, 3, spacings, c) for c in (0.0, 2.0))
    for row, place in np.ndindex(plain.shape):
        difference = errors[place] - errors[0]
        counts, sums = np.empty(5), np.empty(5)
        for o, of_view in enumerate(weights[row].reshape(5, N_BINS)):
            counts[o] = of_view.sum() + 1
            sums[o] = of_view @ difference[o] + difference[o].mean()
        mean = sums.sum() / counts.sum()
        left = sums - mean * counts
        error = np.sqrt(np.sum(left**2) * 5 / 4) / counts.sum()
        assert plain[row, place] == pytest.approx(mean, rel=1e-3, abs=1e-3)
        assert cautious[row, place] == pytest.approx(mean + 2 * error, rel=1e-3, abs=1e-3)
    assert (cautious[:, 0] == 0).all()


def test_one_calibration_object_moves_nothing_from_even_spacing():
    evidence = evidence_of(distributions(0, n_objects=1), **CAUTIOUS)
    belief, taken = first_views(1, evidence), np.zeros((7, 1), dtype=np.int64)
    found = spaced_next(evidence, 3, 15.0)(belief, taken, np.random.default_rng(0))
    assert (found == 120).all()


def test_the_first_view_decides_and_the_others_follow_at_the_same_step():
    evidence = evidence_of(distributions(0, n_objects=6), **CAUTIOUS)
    policy, rng = spaced_next(evidence, 4, 15.0), np.random.default_rng(0)
    belief, taken = first_views(2, evidence), np.zeros((7, 1), dtype=np.int64)
    for _ in range(3):
        taken = np.column_stack([taken, policy(belief, taken, rng)])
    steps = np.diff(np.column_stack([taken, taken[:, -1] + taken[:, 1]]), axis=1) % 360
    assert (steps == steps[:, :1]).all()
    assert circular_distance_deg(taken[:, 1], 0).max() <= 90


def test_spacings_need_distributions_and_a_first_view_of_the_same_estimator():
    evidence, spacings = evidence_of(distributions(0)), spacing_bins(3, N_BINS, 0.0)
    other = first_views(1, evidence_of(distributions(0)))
    with pytest.raises(ValueError, match="one first view by the same estimator"):
        excess_of_spacings(other, evidence, 3, spacings, 0.0)
    blind = replace(evidence, distributions=None)
    with pytest.raises(ValueError, match="need evidence of distributions"):
        excess_of_spacings(first_views(1, blind), blind, 3, spacings, 0.0)

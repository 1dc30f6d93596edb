"""The expected error where the first view gives a distribution and distributions are multiplied."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief
from nbv.core.circle.criteria import CRITERIA, affinity
from nbv.core.circle.evidence import evidence_of_distributions
from nbv.core.circle.fusion import product, rotation_errors_deg
from nbv.core.circle.policies import HeldOutViews, two_views

N_BINS, N_VIEWS = 12, 24
AFFINITY = {"power": 4.0, "pseudo_observations": 5.0}


def distributions(seed, n_objects=3, n_views=N_VIEWS):
    """About the true azimuth, some sharp and some wide; rows sum to 1."""
    rng = np.random.default_rng(seed)
    centres = np.arange(N_BINS) * (360 / N_BINS)
    answer = np.arange(n_views) * (360 / n_views) + rng.normal(0, 40, (n_objects, n_views))
    kappa = rng.uniform(0.3, 4, (n_objects, n_views, 1))
    p = np.exp(kappa * np.cos(np.radians(centres - answer[..., None])))
    return p / p.sum(axis=-1, keepdims=True)


def evidence_of(views, **settings):
    return evidence_of_distributions(views, {"affinity": AFFINITY | settings})


def cost_of(criterion, rows, evidence):
    belief = Belief(rows.astype(np.float32), evidence)
    return CRITERIA[criterion](belief, evidence, "product")


def test_it_is_the_mean_error_weighted_by_affinity_and_shrunk():
    views, rows = distributions(0), distributions(1).reshape(-1, N_BINS)[:5]
    step, shift, turn_deg = N_VIEWS // N_BINS, N_VIEWS // N_BINS, 360 / N_BINS
    expected = np.empty((len(rows), N_BINS))
    for delta in range(N_BINS):
        weighted, weights, plain = np.zeros(len(rows)), np.zeros(len(rows)), []
        for of_object in views:
            for view in range(0, N_VIEWS, step):
                second = of_object[(view + delta * shift) % N_VIEWS]
                pose = product(of_object[view][None], second[None], np.array([delta * turn_deg]))
                error = float(circular_distance_deg(pose, view * 360 / N_VIEWS)[0])
                plain.append(error)
                for index, row in enumerate(rows):
                    weight = 360 / N_BINS * np.sum(np.sqrt(row * of_object[view])) ** 4
                    weighted[index] += weight * error
                    weights[index] += weight
        expected[:, delta] = (weighted + 5 * np.mean(plain)) / (weights + 5)
    found = cost_of("expected_error", rows, evidence_of(views))
    np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize("n_views", [N_BINS, 3 * N_BINS])
def test_errors_of_products_are_those_of_fusing_each_pair(n_views):
    """Also where views lie between bins, and where two images exclude each other."""
    views = distributions(2, n_objects=2, n_views=n_views)
    views[0, 3], views[0, 5 * n_views // N_BINS + 3] = np.eye(N_BINS)[[0, 3]]
    found = rotation_errors_deg(views, evidence_of(views), "product")
    assert found.shape == (N_BINS, 2, n_views)
    for delta in range(N_BINS):
        second = np.roll(views, -delta * (n_views // N_BINS), axis=1)
        turn_deg = np.full((2, n_views), delta * 360.0 / N_BINS)
        pose = product(views, second, turn_deg)
        expected = circular_distance_deg(pose, np.arange(n_views) * (360.0 / n_views))
        np.testing.assert_allclose(found[delta], expected, atol=1e-3)


def test_views_between_the_bins_do_not_count():
    """So kept distributions, a bin apart, lead to the same choices as those of all views."""
    views, rows = distributions(0), distributions(1).reshape(-1, N_BINS)[:5]
    every, kept = evidence_of(views), evidence_of(views[:, :: N_VIEWS // N_BINS])
    for criterion in ("expected_error", "fixed"):
        costs = (cost_of(criterion, rows, evidence) for evidence in (every, kept))
        np.testing.assert_allclose(next(costs), next(costs), rtol=1e-6)


def test_without_trust_in_likeness_it_is_the_best_fixed_rotation():
    views, rows = distributions(0), distributions(1)[0]
    fixed = cost_of("fixed", rows, evidence_of(views))
    assert fixed.shape == (N_VIEWS, N_BINS)
    assert np.ptp(fixed, axis=0).max() == 0
    cautious = cost_of("expected_error", rows, evidence_of(views, pseudo_observations=1e9))
    np.testing.assert_allclose(cautious, fixed, rtol=1e-4)


@given(st.integers(0, 99), st.integers(1, N_BINS - 1))
def test_turning_every_object_leaves_the_recommended_rotations(seed, k):
    views, rows = distributions(seed), distributions(seed + 100)[0]
    turned = np.roll(views, (2 * k, k), axis=(1, 2))
    before = cost_of("expected_error", rows, evidence_of(views))
    after = cost_of("expected_error", np.roll(rows, k, axis=1), evidence_of(turned))
    np.testing.assert_allclose(after, before, rtol=1e-3, atol=1e-3)


@given(st.integers(0, 99))
def test_the_affinity_is_1_of_equals_and_0_of_those_that_exclude_each_other(seed):
    rows = np.random.default_rng(seed).dirichlet(np.full(6, 0.3), 4)
    found = affinity(rows, rows)
    np.testing.assert_allclose(np.diag(found), 1.0)
    np.testing.assert_allclose(found, found.T)
    assert found.min() >= 0
    assert found.max() <= 1 + 1e-9
    excluding = affinity(np.array([[0.5, 0.5, 0, 0]]), np.array([[0, 0, 0.5, 0.5]]))
    assert excluding[0, 0] == 0


@pytest.mark.parametrize("criterion", ["expected_error", "fixed"])
def test_evidence_of_estimates_does_not_serve_the_product(criterion):
    views = distributions(0)
    evidence = replace(evidence_of(views), distributions=None)
    with pytest.raises(ValueError, match="'product' needs evidence of distributions"):
        cost_of(criterion, views[0], evidence)


def test_no_policy_is_better_than_the_oracle_of_products():
    views, evidence = distributions(3), evidence_of(distributions(0, n_objects=6))
    centres = np.exp(1j * np.radians(np.arange(N_BINS) * 30))
    estimate_deg = np.degrees(np.angle(views @ centres)) % 360
    views = HeldOutViews(estimate_deg, evidence, np.random.default_rng(0), distributions=views)
    errors = {
        policy: two_views(policy, "product", views).error_deg
        for policy in ("oracle", "fixed", "expected_error", "information_gain", "opposite")
    }
    for error in errors.values():
        assert (errors["oracle"] <= error + 1e-3).all()
    with pytest.raises(ValueError, match="'product' needs distributions"):
        two_views("oracle", "product", replace(views, distributions=None))

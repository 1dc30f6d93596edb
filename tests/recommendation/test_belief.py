"""Beliefs over any number of looks, against Bayes' rule written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.recommendation.test_definitions import N_BINS, estimates, evidence_of

from nbv.angles import circular_distance_deg
from nbv.recommendation import belief
from nbv.recommendation.criteria import CRITERIA

B = 12


def random_rows(seed, n):
    return np.random.default_rng(seed).dirichlet(np.full(B, 0.5), n)


@pytest.mark.parametrize("criterion", ["entropy", "information_gain", "expected_dispersion"])
def test_at_a_first_estimate_a_criterion_over_beliefs_is_its_lookup_table(criterion):
    evidence = evidence_of()
    bins = np.arange(N_BINS) * (360.0 / N_BINS)
    beliefs = belief.first_beliefs(bins, evidence)
    worth = belief.BELIEF_CRITERIA[criterion](beliefs, evidence)
    np.testing.assert_allclose(worth, CRITERIA[criterion](evidence, "posterior"), atol=3e-5)


def test_beliefs_follow_bayes_rule_look_by_look():
    evidence = evidence_of()
    V, L = evidence.likelihoods.viewpoint, evidence.likelihoods.estimate
    first, looks = 40.0, [(90, 100.0), (240, 300.0), (15, 61.0)]
    beliefs = belief.first_beliefs(np.array([first]), evidence)
    expected = V[int(first / 15 + 0.5)].copy()
    for delta, seen in looks:
        beliefs = belief.updated(beliefs, np.array([seen]), np.array([delta]), evidence)
        for theta in range(N_BINS):
            expected[theta] *= L[(theta + delta // 15) % N_BINS, int(seen / 15 + 0.5) % N_BINS]
    np.testing.assert_allclose(beliefs[0], expected / expected.sum(), rtol=1e-4)
    angles = np.radians(np.arange(N_BINS) * 15.0)
    direction = np.degrees(np.angle(np.sum(expected * np.exp(1j * angles))))
    assert circular_distance_deg(belief.mean_direction_deg(beliefs)[0], direction) < 0.01


def test_the_order_of_looks_does_not_matter():
    evidence, rng = evidence_of(), np.random.default_rng(0)
    seen, delta = rng.uniform(0, 360, 4), rng.integers(0, N_BINS, 4) * 15
    ends = []
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        beliefs = belief.first_beliefs(np.array([10.0]), evidence)
        for k in order:
            beliefs = belief.updated(beliefs, seen[k : k + 1], delta[k : k + 1], evidence)
        ends.append(beliefs)
    np.testing.assert_allclose(*ends, rtol=1e-4)


def test_expected_error_over_beliefs_is_the_mean_over_what_calibration_objects_gave():
    evidence, rng = evidence_of(), np.random.default_rng(1)
    beliefs = rng.dirichlet(np.ones(N_BINS), 2).astype(np.float32)
    worth = belief.expected_error(beliefs, evidence)
    L, angles = evidence.likelihoods.estimate, np.radians(np.arange(N_BINS) * 15.0)
    for n, b in enumerate(beliefs):
        for delta in (0, 5, 17):
            total = weight = 0.0
            for pose in range(0, N_BINS, 2):
                for looks in evidence.estimate_deg:
                    seen = looks[(pose + delta) % N_BINS * 2]
                    e2 = int(seen / 15 + 0.5) % N_BINS
                    after = b * L[(np.arange(N_BINS) + delta) % N_BINS, e2]
                    answer = np.degrees(np.angle(np.sum(after * np.exp(1j * angles))))
                    total += b[pose] * float(circular_distance_deg(answer, pose * 15.0))
                    weight += b[pose]
            assert worth[n, delta] == pytest.approx(total / weight, rel=1e-3)


@pytest.mark.parametrize("k", [1, 10])
@pytest.mark.parametrize("criterion", ["information_gain", "expected_dispersion"])
def test_turning_the_belief_and_the_object_together_changes_nothing(criterion, k):
    evidence, rng = evidence_of(), np.random.default_rng(2)
    turned = evidence_of((np.roll(evidence.estimate_deg, 2 * k, axis=1) + 15 * k) % 360)
    beliefs = rng.dirichlet(np.ones(N_BINS), 3).astype(np.float32)
    one = belief.BELIEF_CRITERIA[criterion](beliefs, evidence)
    other = belief.BELIEF_CRITERIA[criterion](np.roll(beliefs, k, axis=1), turned)
    np.testing.assert_allclose(one, other, atol=1e-4)


def test_coarser_beliefs_keep_their_mass_and_direction():
    fine = np.zeros((3, 360), dtype=np.float32)
    fine[0, 359] = fine[1, 1] = fine[2, 180] = 1
    coarse = belief.coarser(fine, 120)
    assert coarse[0, 0] == coarse[1, 0] == coarse[2, 60] == 1
    assert coarse.sum() == 3


def test_more_views_of_an_honest_estimator_err_less():
    """Answers drawn anew for every look, as the model says."""
    evidence = evidence_of(estimates(30, 360), bandwidth_deg=6.0, n_bins=120)
    unseen = estimates(30, 360, seed=8)
    objects, starts = np.repeat(np.arange(30), 12), np.tile(np.arange(0, 360, 30), 30)
    beliefs = belief.first_beliefs(unseen[objects, starts], evidence)
    errors = [circular_distance_deg(belief.mean_direction_deg(beliefs), starts).mean()]
    for delta in (180, 90, 270):
        turn = np.full(len(starts), delta)
        beliefs = belief.updated(beliefs, unseen[objects, (starts + turn) % 360], turn, evidence)
        errors.append(circular_distance_deg(belief.mean_direction_deg(beliefs), starts).mean())
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]


@given(st.integers(0, 99), st.integers(0, B - 1), st.integers(0, B - 1))
def test_fusing_multiplies_in_the_frame_of_the_first_view(seed, delta, k):
    first, second = random_rows(seed, 1), random_rows(seed + 1, 1)
    found = belief.fuse_beliefs(first, second, np.array([delta * 30]))
    product = [first[0, t] * second[0, (t + delta) % B] for t in range(B)]
    mean = sum(p * np.exp(2j * np.pi * t / B) for t, p in enumerate(product))
    assert circular_distance_deg(found[0], np.degrees(np.angle(mean))) < 1e-6
    turned = belief.fuse_beliefs(
        np.roll(first, k, axis=1), np.roll(second, k, axis=1), np.array([delta * 30])
    )
    assert circular_distance_deg(turned[0], found[0] + 30 * k) < 1e-6


def test_images_that_exclude_each_other_fall_back_on_the_first():
    first, second = np.eye(B)[[3]], np.eye(B)[[8]]
    assert belief.fuse_beliefs(first, second, np.array([60]))[0] == pytest.approx(90)


def test_beliefs_in_parts_give_what_they_give_at_once(monkeypatch):
    evidence = evidence_of()
    beliefs = np.random.default_rng(5).dirichlet(np.ones(N_BINS), 7).astype(np.float32)
    whole = belief.worth("information_gain", beliefs, evidence)
    monkeypatch.setattr(belief, "_CHUNK", 3 * N_BINS**2)
    np.testing.assert_allclose(
        belief.worth("information_gain", beliefs, evidence), whole, atol=1e-5
    )

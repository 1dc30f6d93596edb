from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nbv.angles import circular_distance_deg
from nbv.calibration.density import likelihoods
from nbv.recommendation import belief

B = 12


def random_rows(seed: int, n: int = B, n_bins: int = B) -> np.ndarray:
    return np.random.default_rng(seed).dirichlet(np.full(n_bins, 0.5), n)


def posterior_entropy(b: np.ndarray, L: np.ndarray, delta: int) -> float:
    """The mean entropy of the posteriors after each possible second estimate."""
    n = len(b)
    total = 0.0
    for estimate in range(n):
        joint = np.array([b[pose] * L[(pose + delta) % n, estimate] for pose in range(n)])
        chance = joint.sum()
        if chance > 0:
            posterior = joint[joint > 0] / chance
            total -= chance * (posterior * np.log(posterior)).sum()
    return total


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 999))
def test_expected_entropy_is_the_mean_over_every_answer(seed):
    beliefs, L = random_rows(seed, 3), random_rows(seed + 1)
    found = belief.expected_entropy(beliefs, L)
    expected = [[posterior_entropy(b, L, delta) for delta in range(B)] for b in beliefs]
    np.testing.assert_allclose(found, expected, atol=2e-5)


@given(st.integers(0, 99), st.integers(0, B - 1))
def test_turning_the_object_changes_no_recommendations_worth(seed, k):
    beliefs, L = random_rows(seed, 4), random_rows(seed + 1)
    turned = belief.expected_entropy(np.roll(beliefs, k, axis=1), np.roll(L, (k, k), (0, 1)))
    np.testing.assert_allclose(turned, belief.expected_entropy(beliefs, L), atol=1e-5)


def test_images_in_parts_give_what_they_give_at_once(monkeypatch):
    beliefs, L = random_rows(5, 7), random_rows(6)
    whole = belief.expected_entropy(beliefs, L)
    monkeypatch.setattr(belief, "_CHUNK", 3 * B**2)
    np.testing.assert_allclose(belief.expected_entropy(beliefs, L), whole, atol=1e-6)


def test_a_second_look_that_says_nothing_leaves_the_belief_and_the_camera():
    beliefs = random_rows(0, 5)
    L = np.full((B, B), 1 / B)
    own = -(beliefs * np.log(beliefs)).sum(axis=1)
    np.testing.assert_allclose(
        belief.expected_entropy(beliefs, L), own[:, None] + np.zeros(B), atol=1e-5
    )


def test_it_looks_where_two_poses_can_be_told_apart():
    """The pose is 0 or 30; views within 40 degrees of 135 are known, all others answer 300."""
    truth = np.repeat(np.arange(360.0), 20)
    noise = np.random.default_rng(0).normal(0, 1, truth.size)
    seen = circular_distance_deg(truth, 135) < 40
    answers = np.where(seen, truth + noise, 300.0) % 360
    L = likelihoods(answers, truth, bandwidth_deg=5, pseudo_observations=1, n_bins=36).estimate
    b = np.zeros((1, 36))
    b[0, [0, 3]] = 0.5
    delta = belief.recommend(b, L)[0]
    assert circular_distance_deg([delta, delta + 30], 135).min() <= 40
    assert delta % 10 == 0


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

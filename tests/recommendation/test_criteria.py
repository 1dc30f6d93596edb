from __future__ import annotations

import math

import numpy as np
import pytest

from nbv.calibration.density import Likelihoods, likelihoods
from nbv.errors import UserError
from nbv.recommendation.criteria.pose_ambiguity import READINGS
from nbv.recommendation.criteria.pose_ambiguity import pose_ambiguity as ambiguity_of
from nbv.recommendation.evidence import Evidence

SETTINGS = {"reading": "given_estimate", "spread": "entropy"}


def pose_ambiguity(pair: Likelihoods, settings: dict[str, str]) -> np.ndarray:
    return ambiguity_of(Evidence(np.zeros((1, pair.n_bins)), pair, 10, 2, settings), "average")


def random_likelihoods(n_bins: int, seed: int = 0) -> Likelihoods:
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 360, 400).astype(float)
    estimate = (truth + rng.normal(0, 30, 400)) % 360
    return likelihoods(estimate, truth, bandwidth_deg=10, pseudo_observations=2, n_bins=n_bins)


def plain_loops(V, T, spread):
    """The definition, term by term: Eqs. 1, 3 and 6."""
    n = len(V)
    A = np.empty((n, n))
    for e in range(n):
        for delta in range(n):
            p = [0.0] * n
            for phi in range(n):
                row = [T[phi][t] * T[(phi + delta) % n][(t + delta) % n] for t in range(n)]
                total = sum(row)
                for t in range(n):
                    p[t] += V[e][phi] * (row[t] / total if total else 1 / n)
            A[e, delta] = spread(p)
    return A


def plain_entropy(p):
    return -sum(x * math.log(x) for x in p if x > 0)


def plain_circular_variance(p):
    n = len(p)
    x = sum(q * math.cos(2 * math.pi * k / n) for k, q in enumerate(p))
    y = sum(q * math.sin(2 * math.pi * k / n) for k, q in enumerate(p))
    return 1 - math.hypot(x, y)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize(
    ("spread", "plain"),
    [("entropy", plain_entropy), ("circular_variance", plain_circular_variance)],
)
def test_the_table_is_the_triple_loop(reading, spread, plain):
    pair = random_likelihoods(12)
    T = pair.viewpoint if reading == "given_estimate" else pair.estimate
    expected = plain_loops(pair.viewpoint.tolist(), T.tolist(), plain)
    table = pose_ambiguity(pair, {"reading": reading, "spread": spread})
    np.testing.assert_allclose(table, expected, atol=2e-5)


@pytest.mark.parametrize("k", [1, 7, 19])
def test_turning_the_object_rolls_the_rows_and_leaves_the_rotations(k):
    pair = random_likelihoods(24)
    turned = Likelihoods(
        np.roll(pair.viewpoint, (k, k), (0, 1)), np.roll(pair.estimate, (k, k), (0, 1))
    )
    before = pose_ambiguity(pair, SETTINGS)
    np.testing.assert_allclose(
        np.roll(before, k, axis=0), pose_ambiguity(turned, SETTINGS), atol=1e-5
    )


def test_an_estimator_that_knows_nothing_is_maximally_ambiguous_everywhere():
    uniform = np.full((36, 36), 1 / 36)
    table = pose_ambiguity(Likelihoods(uniform, uniform), SETTINGS)
    np.testing.assert_allclose(table, math.log(36), rtol=1e-5)


def test_a_perfect_estimator_leaves_no_ambiguity():
    table = pose_ambiguity(Likelihoods(np.eye(36), np.eye(36)), SETTINGS)
    np.testing.assert_allclose(table, 0.0, atol=1e-6)


def test_answers_that_exclude_each_other_say_nothing():
    T = np.roll(np.eye(4), 1, axis=1)
    T[1] = [1, 0, 0, 0]  # disagrees with the view from bin 0, turned by 1
    table = pose_ambiguity(Likelihoods(T, T), SETTINGS)
    expected = plain_loops(T.tolist(), T.tolist(), plain_entropy)
    np.testing.assert_allclose(table, expected, atol=1e-6)


def test_where_the_pose_is_hidden_the_way_out_is_the_least_ambiguous():
    """Answers between 45 and 135 degrees say nothing more than that; all others are sharp."""
    rng = np.random.default_rng(0)
    truth = np.tile(np.arange(360.0), 40)
    hidden = np.abs(truth - 90) < 45
    answer = np.where(
        hidden, rng.uniform(45, 135, len(truth)), truth + rng.normal(0, 3, len(truth))
    )
    pair = likelihoods(answer % 360, truth, bandwidth_deg=6, pseudo_observations=10)
    table = pose_ambiguity(pair, SETTINGS)
    best = int(table[90].argmin())
    assert table[90, best] < table[90, 0]
    assert not 45 < 90 + best < 135


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"reading": "given_truht", "spread": "entropy"}, "did you mean 'given_truth'"),
        ({"reading": "given_truth", "spread": "entrophy"}, "did you mean 'entropy'"),
    ],
)
def test_unknown_names(settings, message):
    with pytest.raises(UserError, match=message):
        pose_ambiguity(random_likelihoods(8), settings)

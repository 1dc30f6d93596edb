"""The criteria and the fusion beyond the paper, against their definitions term by term."""

from __future__ import annotations

import numpy as np
import pytest

from nbv.angles import circular_distance_deg
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.density_selection import choose_densities
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.fusion import (
    FUSIONS,
    average,
    posterior,
    rotation_errors_deg,
    second_look,
    two_view_error_deg,
)
from nbv.recommendation.lookup import build_lookup, least_ambiguous_delta
from nbv.recommendation.policies import oracle, rotate

N_BINS = 24
SETTINGS = {"reading": "given_estimate", "spread": "entropy"}


def estimates(n_objects=3, n_views=48, seed=0):
    rng = np.random.default_rng(seed)
    truth = np.arange(n_views) * (360.0 / n_views)
    spread = 8 + 60 * np.exp(-(((truth - 90) / 40) ** 2))
    return (truth + rng.normal(0, spread, (n_objects, n_views))) % 360


def evidence_of(estimate_deg=None, bandwidth_deg=12.0, pseudo_observations=2.0, n_bins=N_BINS):
    return gather_evidence(
        estimates() if estimate_deg is None else estimate_deg,
        SETTINGS,
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        n_bins=n_bins,
    )


def posteriors(evidence, e1, delta):
    """p(e2 | e1, delta) and p(theta | e1, delta, e2) by Bayes' rule, one number at a time."""
    V, L, n = evidence.likelihoods.viewpoint, evidence.likelihoods.estimate, evidence.n_bins
    joint = np.array(
        [[V[e1, theta] * L[(theta + delta) % n, e2] for theta in range(n)] for e2 in range(n)]
    )
    return joint.sum(axis=1), joint / joint.sum(axis=1, keepdims=True)


def test_information_gain_is_the_expected_entropy_of_the_posterior():
    evidence = evidence_of()
    expected = np.empty((N_BINS, N_BINS))
    for e in range(N_BINS):
        for delta in range(N_BINS):
            chance, after = posteriors(evidence, e, delta)
            expected[e, delta] = chance @ -(after * np.log(after)).sum(axis=1)
    table = CRITERIA["information_gain"](evidence, "average")
    np.testing.assert_allclose(table, expected, atol=2e-5)


def test_expected_dispersion_is_the_bayes_risk_of_the_best_answer():
    """Minimised over a fine grid of answers, not by the formula of the mean direction."""
    evidence = evidence_of()
    angles = 2 * np.pi * np.arange(N_BINS) / N_BINS
    answers = np.radians(np.arange(0, 360, 0.25))
    loss = 1 - np.cos(answers[:, None] - angles)
    expected = np.empty((N_BINS, N_BINS))
    for e in range(N_BINS):
        for delta in range(N_BINS):
            chance, after = posteriors(evidence, e, delta)
            expected[e, delta] = chance @ (after @ loss.T).min(axis=1)
    table = CRITERIA["expected_dispersion"](evidence, "average")
    np.testing.assert_allclose(table, expected, atol=2e-5)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_expected_error_is_the_kernel_regression_of_the_error_shrunk_to_its_mean(fusion):
    evidence = evidence_of()
    estimate, alpha = evidence.estimate_deg, 2.0 * 360 / N_BINS
    n_objects, n_views = estimate.shape
    angles = np.radians(np.arange(N_BINS) * 360.0 / N_BINS)
    kernel = np.exp((np.cos(angles) - 1) / np.radians(12.0) ** 2)
    kernel /= kernel.sum()
    nearest = np.floor(estimate / (360 / N_BINS) + 0.5).astype(int) % N_BINS
    expected = np.empty((N_BINS, N_BINS))
    for delta in range(N_BINS):
        turn, weight, error, plain = delta * 360 / N_BINS, np.zeros(N_BINS), np.zeros(N_BINS), []
        for o in range(n_objects):
            for view in range(0, n_views, n_views // N_BINS):
                second = estimate[o, (view + delta * n_views // N_BINS) % n_views]
                fused = FUSIONS[fusion](estimate[o, view], second, turn, evidence)
                made = float(circular_distance_deg(fused, view * 360 / n_views))
                plain.append(made)
                for e in range(N_BINS):
                    w = n_views // N_BINS * kernel[(e - nearest[o, view]) % N_BINS]
                    weight[e] += w
                    error[e] += w * made
        expected[:, delta] = (error + alpha * np.mean(plain)) / (weight + alpha)
    table = CRITERIA["expected_error"](evidence, fusion)
    np.testing.assert_allclose(table, expected, rtol=1e-4)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_fixed_is_expected_error_without_any_trust_in_the_estimate(fusion):
    fixed = CRITERIA["fixed"](evidence_of(), fusion)
    shrunk = CRITERIA["expected_error"](evidence_of(pseudo_observations=0.0), fusion)
    assert np.ptp(fixed, axis=0).max() == 0
    far = gather_evidence(
        estimates(), SETTINGS, bandwidth_deg=12.0, pseudo_observations=1e9, n_bins=N_BINS
    )
    if fusion == "average":  # posterior fusion under such a density is another rule
        np.testing.assert_allclose(CRITERIA["expected_error"](far, fusion), fixed, rtol=1e-4)
    assert np.ptp(shrunk, axis=0).max() > 1


@pytest.mark.parametrize("k", [1, 7, 19])
@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize("criterion", CRITERIA)
def test_turning_the_object_rolls_the_rows_and_leaves_the_rotations(criterion, fusion, k):
    """The views of the turned object: its azimuths and its estimates are k bins further on."""
    before = evidence_of()
    views = k * before.estimate_deg.shape[1] // N_BINS
    turned = (np.roll(before.estimate_deg, views, axis=1) + k * 360 / N_BINS) % 360
    after = evidence_of(turned)
    np.testing.assert_allclose(
        CRITERIA[criterion](after, fusion),
        np.roll(CRITERIA[criterion](before, fusion), k, axis=0),
        rtol=2e-3,
        atol=2e-5,
    )


def test_a_look_that_says_nothing_gains_nothing():
    """From uniform answers the posterior is the prior, whatever the rotation."""
    rng = np.random.default_rng(0)
    evidence = evidence_of(rng.uniform(0, 360, (200, 48)), pseudo_observations=1e9)
    table = CRITERIA["information_gain"](evidence, "average")
    np.testing.assert_allclose(table, np.log(N_BINS), atol=1e-4)


def test_posterior_fusion_is_the_direction_of_the_sum():
    evidence = evidence_of()
    rng = np.random.default_rng(3)
    first, second = rng.uniform(0, 360, (2, 40))
    delta = rng.integers(0, N_BINS, 40) * (360 / N_BINS)
    fused = posterior(first, second, delta, evidence)
    V, L = evidence.likelihoods.viewpoint, evidence.likelihoods.estimate
    for one in range(40):
        e1, e2 = (int(np.floor(x / 15 + 0.5)) % N_BINS for x in (first[one], second[one]))
        total = sum(
            V[e1, t] * L[(t + int(delta[one] // 15)) % N_BINS, e2] * np.exp(2j * np.pi * t / N_BINS)
            for t in range(N_BINS)
        )
        assert circular_distance_deg(fused[one], np.degrees(np.angle(total))) < 0.01


def test_many_pairs_at_once_are_fused_like_few():
    evidence = evidence_of()
    rng = np.random.default_rng(4)
    first, second = rng.uniform(0, 360, (2, 30, 100))
    delta = rng.integers(0, N_BINS, (30, 100)) * (360 / N_BINS)
    assert first.size > 2 * N_BINS**2
    at_once = posterior(first, second, delta, evidence)
    few = np.stack([posterior(*row, evidence) for row in zip(first, second, delta, strict=True)])
    bins = [np.floor(x / 15 + 0.5).astype(int) % N_BINS for x in (delta, first, second)]
    real, imaginary = (evidence.moments[bins[0], part, bins[1], bins[2]] for part in (0, 1))
    # Where the posterior has next to no direction, rounding chooses one.
    told = np.hypot(real, imaginary) > 1e-4
    assert told.mean() > 0.9
    assert circular_distance_deg(at_once, few)[told].max() < 0.01


def test_posterior_fusion_trusts_the_look_that_can_be_trusted():
    """Near 90 degrees this estimator guesses; the other look decides there."""
    calibration, unseen = estimates(20, 360), estimates(20, 360, seed=1)
    evidence = evidence_of(calibration, bandwidth_deg=6.0, n_bins=120)
    opposite = np.full(unseen.shape, 180)
    by_average = two_view_error_deg(unseen, opposite)
    by_posterior = two_view_error_deg(unseen, opposite, "posterior", evidence)
    hidden = slice(60, 120)
    assert by_posterior[:, hidden].mean() < 0.6 * by_average[:, hidden].mean()


def test_posterior_fusion_needs_evidence():
    with pytest.raises(ValueError, match="needs evidence"):
        posterior(0.0, 0.0, 0.0)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_the_oracle_is_the_least_of_all_rotations(fusion):
    evidence, unseen = evidence_of(), estimates(2, seed=6)
    every = rotation_errors_deg(unseen, evidence, fusion)
    delta = oracle(unseen, evidence, fusion)
    reached = two_view_error_deg(unseen, delta, fusion, evidence)
    np.testing.assert_allclose(reached, every.min(axis=0), atol=1e-4)
    for index in (0, 5, 23):
        turn = np.full(unseen.shape, index * 15)
        taken = FUSIONS[fusion](unseen, second_look(unseen, turn), turn, evidence)
        error = circular_distance_deg(taken, np.arange(48) * 7.5)
        np.testing.assert_allclose(every[index], error, atol=1e-3)


def test_rotations_by_name():
    evidence, unseen, rng = evidence_of(), estimates(2, seed=6), np.random.default_rng(0)
    assert (rotate("opposite", "average", unseen, evidence, rng) == 180).all()
    table = build_lookup(evidence, "information_gain")
    chosen = rotate("information_gain", "average", unseen, evidence, rng)
    np.testing.assert_array_equal(chosen, table.recommend(unseen))


def test_travel_that_costs_is_avoided_and_limits_are_kept():
    rng = np.random.default_rng(0)
    ambiguity = rng.uniform(0, 1, (50, 72))
    travel = np.minimum(np.arange(72) * 5, 360 - np.arange(72) * 5)
    for cost in (0.0, 0.002, 0.05):
        chosen = least_ambiguous_delta(ambiguity, travel_cost=cost)
        expected = (ambiguity + cost * travel).min(axis=1)
        bins = chosen // 5
        reached = ambiguity[np.arange(50), bins] + cost * travel[bins]
        np.testing.assert_allclose(reached, expected)
    near = least_ambiguous_delta(ambiguity, max_travel_deg=60) // 5
    assert travel[near].max() <= 60
    within = np.where(travel <= 60, ambiguity, np.inf)
    np.testing.assert_array_equal(ambiguity[np.arange(50), near], within.min(axis=1))
    assert (least_ambiguous_delta(ambiguity, max_travel_deg=0) == 0).all()


def test_densities_of_several_methods_are_chosen_as_each_would_be_alone():
    grid = {"bandwidths_deg": [6, 12], "pseudo_observations": [3, 30], "n_parts": 3}
    methods = {
        "a": {"rotation": "information_gain", "fusion": "posterior"},
        "b": {"rotation": "random", "fusion": "posterior"},
        "c": {"rotation": "entropy", "fusion": "average"},
    }
    calibration, settings = estimates(5, 360), SETTINGS | grid
    together = choose_densities(calibration, methods, settings, n_bins=60)
    for name, method in methods.items():
        alone = choose_densities(calibration, {name: method}, settings, n_bins=60)
        assert alone[name] == together[name]
        assert together[name].error_deg == min(together[name].candidate_error_deg.values())


@pytest.mark.parametrize("delta", [0.0, 90.0])
def test_both_fusions_agree_where_both_looks_are_right(delta):
    evidence = evidence_of(np.tile(np.arange(48) * 7.5, (5, 1)), pseudo_observations=0.1)
    pose = np.arange(N_BINS) * (360.0 / N_BINS)
    fused = posterior(pose, pose + delta, delta, evidence)
    assert circular_distance_deg(fused, average(pose, pose + delta, delta)).max() < 1.0

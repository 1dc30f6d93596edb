"""Criteria against their definitions, term by term: as tables, and over beliefs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.simulation import FOR_MORE_VIEWS, coarser, updated

from made_estimates import N_BINS, SETTINGS, estimates, evidence_of
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief, every_belief, first_belief
from nbv.core.circle.criteria import (
    CRITERIA,
    POSE_LIKELIHOODS,
    SPREADS,
    affinity,
    cost_unit,
    pose_likelihood,
    rotation_groups,
    tabulate,
    two_view_poses,
)
from nbv.core.circle.density import Conditionals, conditionals
from nbv.core.circle.evidence import Evidence, evidence_of_distributions, gather_evidence
from nbv.core.circle.fusion import ESTIMATE_FUSIONS, FUSIONS, product, rotation_errors_deg
from nbv.core.circle.policies import HeldOutViews, two_views
from nbv.errors import UserError

ANGLES = 2 * np.pi * np.arange(N_BINS) / N_BINS


def told(criterion, cost):
    """The costs without that of half a turn where rounding has a say in it.

    Two equal answers from opposite views leave two equal peaks half a turn apart, hence no mean
    direction to have an error.
    """
    return np.delete(cost, N_BINS // 2, axis=1) if criterion == "bayes_error" else cost


def ambiguity_table(pair: Conditionals, settings: dict[str, str]) -> np.ndarray:
    evidence = Evidence(np.zeros((1, pair.n_bins)), pair, 10, 2, settings)
    return CRITERIA["pose_ambiguity"](every_belief(evidence), evidence, "average")


def random_conditionals(n_bins: int, seed: int = 0) -> Conditionals:
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 360, 400).astype(float)
    estimate = (truth + rng.normal(0, 30, 400)) % 360
    return conditionals(estimate, truth, bandwidth_deg=10, pseudo_observations=2, n_bins=n_bins)


def plain_loops(beliefs, first, second, spread):
    """The definition, term by term: Eqs. 1, 3 and 6."""
    n = len(first)
    A = np.empty((len(beliefs), n))
    for row, b in enumerate(beliefs):
        for delta in range(n):
            p = [0.0] * n
            for phi in range(n):
                other = second[(phi + delta) % n]
                terms = [first[phi][t] * other[(t + delta) % n] for t in range(n)]
                total = sum(terms)
                for t in range(n):
                    p[t] += b[phi] * (terms[t] / total if total else 1 / n)
            A[row, delta] = spread(p)
    return A


def plain_entropy(p):
    return -sum(x * math.log(x) for x in p if x > 0)


def plain_circular_variance(p):
    n = len(p)
    x = sum(q * math.cos(2 * math.pi * k / n) for k, q in enumerate(p))
    y = sum(q * math.sin(2 * math.pi * k / n) for k, q in enumerate(p))
    return 1 - math.hypot(x, y)


def after_each(evidence, b, delta):
    """p(e | b, delta) and p(theta | b, delta, e) by Bayes' rule, one number at a time."""
    L = evidence.conditionals.estimate
    joint = np.array(
        [[b[t] * L[(t + delta) % N_BINS, e] for t in range(N_BINS)] for e in range(N_BINS)]
    )
    return joint.sum(axis=1), joint / joint.sum(axis=1, keepdims=True)


@pytest.fixture(scope="module")
def belief():
    """Beliefs as they are after one view and others as no first estimate gives them."""
    evidence, rng = evidence_of(), np.random.default_rng(2)
    drawn = rng.dirichlet(np.ones(N_BINS), 3).astype(np.float32)
    return Belief(np.concatenate([evidence.viewpoint[:3], drawn]), evidence)


def pose_table(pair, interpretation):
    V, L = pair.viewpoint.tolist(), pair.estimate.tolist()
    if interpretation == "through_estimate":
        n = range(len(V))
        return [[sum(L[phi][e] * V[e][theta] for e in n) for theta in n] for phi in n]
    return {"given_estimate": V, "given_truth": L}[interpretation]


@pytest.mark.parametrize("interpretation", POSE_LIKELIHOODS)
@pytest.mark.parametrize(
    ("spread", "plain"),
    [("entropy", plain_entropy), ("circular_variance", plain_circular_variance)],
)
def test_the_pose_ambiguity_is_the_triple_loop(interpretation, spread, plain):
    pair = random_conditionals(12)
    T = pose_table(pair, interpretation)
    table = ambiguity_table(pair, {"pose_likelihood": interpretation, "spread": spread})
    expected = plain_loops(pair.viewpoint.tolist(), T, T, plain)
    np.testing.assert_allclose(table, expected, atol=2e-5)


@pytest.mark.parametrize("delta", [0, 1, 11])
def test_poses_of_two_views_are_the_mixture_whose_spread_is_tabulated(delta):
    pair = random_conditionals(12)
    shown: list[list[float]] = []

    def kept(p):
        shown.append(list(p))
        return 0.0

    plain_loops(pair.viewpoint.tolist(), pair.estimate.tolist(), pair.estimate.tolist(), kept)
    found = two_view_poses(pair.viewpoint.astype("f4"), pair.estimate.astype("f4"), delta)
    # One row after the other, each at every rotation.
    np.testing.assert_allclose(found, np.array(shown).reshape(12, 12, 12)[:, delta], atol=1e-5)


@pytest.mark.parametrize("spread", SPREADS)
def test_spreads_and_tables_are_in_single_precision(spread):
    pair = random_conditionals(12)
    for name in POSE_LIKELIHOODS:
        assert pose_likelihood(pair, name).dtype == np.float32
    rows = pair.viewpoint.astype(np.float32)
    assert SPREADS[spread](rows).dtype == np.float32
    evidence = evidence_of()
    for criterion in CRITERIA:
        assert tabulate(criterion, evidence, "average").dtype == np.float32


@pytest.mark.parametrize("numbers_each", [0, 1, 1000, 2**15, 2**16, 2**17])
def test_groups_of_rotations_are_all_of_them_in_order_and_fit_the_cache(numbers_each):
    groups = list(rotation_groups(360, numbers_each))
    assert [delta for group in groups for delta in group] == list(range(360))
    # The largest array has 2^16 numbers, or those of one rotation.
    most = max(1, 2**16 // max(1, numbers_each))
    assert len(groups[0]) == min(360, most)
    assert max(len(group) for group in groups) == len(groups[0])


def test_each_factor_of_the_pose_ambiguity_belongs_to_the_estimator_of_its_view():
    """T of the first estimator for the first view, the other's for the second.

    With the second estimator's T for both, the cost would differ by far more than rounding.
    """
    first = evidence_of(estimates(9), pseudo_observations=0.1)
    second = evidence_of(estimates(9, seed=3, worst_deg=250.0), pseudo_observations=0.1)
    belief = first_belief(np.array([30.0, 90.0, 200.0]), first)
    found = CRITERIA["pose_ambiguity"](belief, second, "posterior")
    T, other = (each.conditionals.viewpoint.tolist() for each in (first, second))
    b = belief.probabilities.tolist()
    np.testing.assert_allclose(found, plain_loops(b, T, other, plain_entropy), atol=3e-5)
    assert np.abs(found - plain_loops(b, other, other, plain_entropy)).max() > 0.01


def test_the_pose_ambiguity_is_refused_after_more_than_one_view():
    evidence = evidence_of()
    belief = updated(
        first_belief(np.array([10.0]), evidence), np.array([200.0]), np.array([180]), evidence
    )
    with pytest.raises(ValueError, match="two views, not 3"):
        CRITERIA["pose_ambiguity"](belief, evidence, "posterior")
    assert "pose_ambiguity" not in FOR_MORE_VIEWS


def test_information_gain_is_the_expected_entropy_of_the_posterior(belief):
    found = CRITERIA["information_gain"](belief, belief.evidence, "average")
    for row, b in enumerate(belief.probabilities.astype(float)):
        for delta in range(N_BINS):
            chance, after = after_each(belief.evidence, b, delta)
            expected = chance @ -(after * np.log(after)).sum(axis=1)
            assert found[row, delta] == pytest.approx(expected, abs=3e-5)


def test_expected_dispersion_is_the_bayes_risk_of_the_best_answer(belief):
    """Minimised over a fine grid of answers, not by the formula of the mean direction."""
    answers = np.radians(np.arange(0, 360, 0.25))
    loss = 1 - np.cos(answers[:, None] - ANGLES)
    found = CRITERIA["expected_dispersion"](belief, belief.evidence, "average")
    for row, b in enumerate(belief.probabilities.astype(float)):
        for delta in range(N_BINS):
            chance, after = after_each(belief.evidence, b, delta)
            expected = chance @ (after @ loss.T).min(axis=1)
            assert found[row, delta] == pytest.approx(expected, abs=3e-5)


def test_bayes_error_is_the_mean_over_what_calibration_objects_gave(belief):
    evidence = belief.evidence
    found = CRITERIA["bayes_error"](belief, evidence, "posterior")
    L = evidence.conditionals.estimate
    for row in (0, 5):
        b = belief.probabilities[row]
        for delta in (0, 5, 17):
            total = weight = 0.0
            for pose in range(0, N_BINS, 2):
                for views in evidence.estimate_deg:
                    seen = views[(pose + delta) % N_BINS * 2]
                    e2 = int(seen / 15 + 0.5) % N_BINS
                    after = b * L[(np.arange(N_BINS) + delta) % N_BINS, e2]
                    answer = np.degrees(np.angle(np.sum(after * np.exp(1j * ANGLES))))
                    total += b[pose] * float(circular_distance_deg(answer, pose * 15.0))
                    weight += b[pose]
            assert found[row, delta] == pytest.approx(total / weight, rel=1e-3)


@pytest.mark.parametrize("n_objects", [3, 400])
@pytest.mark.parametrize("criterion", FOR_MORE_VIEWS)
def test_a_lookup_table_is_the_criterion_at_the_beliefs_of_its_estimates(criterion, n_objects):
    """One belief at a time: groups of rotations and kept moments change nothing.

    With many objects all rotations do not fit the cache at once.
    """
    evidence = evidence_of(estimates(n_objects))
    table = tabulate(criterion, evidence, "posterior")
    for one in (0, 7):
        belief = first_belief(np.array([15.0 * one]), evidence)
        cost = told(criterion, CRITERIA[criterion](belief, evidence, "posterior"))
        np.testing.assert_allclose(cost[0], told(criterion, table)[one], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("fusion", ESTIMATE_FUSIONS)
def test_expected_error_is_the_kernel_regression_of_the_error_shrunk_to_its_mean(fusion):
    evidence = evidence_of()
    estimate, alpha = evidence.estimate_deg, 2.0 * 360 / N_BINS
    n_objects, n_views = estimate.shape
    kernel = np.exp((np.cos(ANGLES) - 1) / np.radians(12.0) ** 2)
    kernel /= kernel.sum()
    nearest = np.floor(estimate / (360 / N_BINS) + 0.5).astype(int) % N_BINS
    expected = np.empty((N_BINS, N_BINS))
    for delta in range(N_BINS):
        rotation_deg, weight, error, plain = (
            delta * 360 / N_BINS,
            np.zeros(N_BINS),
            np.zeros(N_BINS),
            [],
        )
        for o in range(n_objects):
            for view in range(0, n_views, n_views // N_BINS):
                second = estimate[o, (view + delta * n_views // N_BINS) % n_views]
                fused = FUSIONS[fusion](estimate[o, view], second, rotation_deg, evidence)
                made = float(circular_distance_deg(fused, view * 360 / n_views))
                plain.append(made)
                for e in range(N_BINS):
                    w = n_views // N_BINS * kernel[(e - nearest[o, view]) % N_BINS]
                    weight[e] += w
                    error[e] += w * made
        expected[:, delta] = (error + alpha * np.mean(plain)) / (weight + alpha)
    np.testing.assert_allclose(tabulate("expected_error", evidence, fusion), expected, rtol=1e-4)


@pytest.mark.parametrize("fusion", ESTIMATE_FUSIONS)
def test_fixed_is_expected_error_without_any_trust_in_the_estimate(fusion):
    fixed = tabulate("fixed", evidence_of(), fusion)
    trusting = tabulate("expected_error", evidence_of(pseudo_observations=0.0), fusion)
    assert np.ptp(fixed, axis=0).max() == 0
    if fusion == "average":  # posterior fusion under such a density is another rule
        far = tabulate("expected_error", evidence_of(pseudo_observations=1e9), fusion)
        np.testing.assert_allclose(far, fixed, rtol=1e-4)
    assert np.ptp(trusting, axis=0).max() > 1


@pytest.mark.parametrize("criterion", ["expected_error", "fixed"])
def test_errors_of_two_views_are_known_for_one_first_view_by_the_same_estimator(criterion):
    evidence = evidence_of()
    belief = first_belief(np.array([10.0]), evidence)
    cost = CRITERIA[criterion](belief, evidence, "average")
    np.testing.assert_array_equal(cost[0], tabulate(criterion, evidence, "average")[1])
    for unknown, other in (
        (replace(belief, n_views=2), evidence),
        (belief, evidence_of()),
    ):
        with pytest.raises(
            ValueError, match=r"^errors of two views need one first view by the same estimator$"
        ):
            CRITERIA[criterion](unknown, other, "average")


def test_an_expected_error_of_estimates_needs_an_estimate():
    evidence = evidence_of()
    belief = replace(first_belief(np.array([10.0]), evidence), first_bin=None)
    with pytest.raises(ValueError, match=r"^fusion 'average' needs a first estimate$"):
        CRITERIA["expected_error"](belief, evidence, "average")


@pytest.mark.parametrize("k", [1, 7, 19])
@pytest.mark.parametrize("fusion", ESTIMATE_FUSIONS)
@pytest.mark.parametrize("criterion", CRITERIA)
def test_turning_the_object_rolls_the_rows_and_leaves_the_rotations(criterion, fusion, k):
    """The views of the rotated object: its azimuths and its estimates are k bins further on."""
    if criterion == "bayes_error" and k % 2:
        k += 1  # It takes every second bin of the pose.
    before = evidence_of()
    after = evidence_of((np.roll(before.estimate_deg, 2 * k, axis=1) + k * 15) % 360)
    np.testing.assert_allclose(
        told(criterion, tabulate(criterion, after, fusion)),
        told(criterion, np.roll(tabulate(criterion, before, fusion), k, axis=0)),
        rtol=2e-3,
        atol=2e-5,
    )


@pytest.mark.parametrize("k", [2, 10])
@pytest.mark.parametrize("criterion", ["pose_ambiguity", *FOR_MORE_VIEWS])
def test_turning_the_belief_and_the_object_together_changes_nothing(criterion, belief, k):
    evidence = belief.evidence
    rotated = evidence_of((np.roll(evidence.estimate_deg, 2 * k, axis=1) + 15 * k) % 360)
    after = Belief(np.roll(belief.probabilities, k, axis=1), rotated)
    np.testing.assert_allclose(
        told(criterion, CRITERIA[criterion](belief, evidence, "posterior")),
        told(criterion, CRITERIA[criterion](after, rotated, "posterior")),
        rtol=1e-3,
        atol=1e-4,
    )


def test_answers_that_exclude_each_other_say_nothing():
    T = np.roll(np.eye(5), 1, axis=1)
    T[1] = [1, 0, 0, 0, 0]  # disagrees with the view from bin 0, rotated by 1
    table = ambiguity_table(Conditionals(T, T), SETTINGS)
    expected = plain_loops(T.tolist(), T.tolist(), T.tolist(), plain_entropy)
    np.testing.assert_allclose(table, expected, atol=1e-6)


def test_each_cost_has_its_unit():
    variance = SETTINGS | {"spread": "circular_variance"}
    assert {name: cost_unit(name, SETTINGS) for name in CRITERIA} == {
        "pose_ambiguity": "nats",
        "information_gain": "nats",
        "expected_dispersion": "1",
        "bayes_error": "degrees",
        "expected_error": "degrees",
        "fixed": "degrees",
    }
    assert cost_unit("pose_ambiguity", variance) == "1"
    assert cost_unit("information_gain", variance) == "nats"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"pose_likelihood": "given_truht", "spread": "entropy"},
            r"^pose likelihood 'given_truht' .*'given_truth'",
        ),
        (
            {"pose_likelihood": "given_truth", "spread": "entrophy"},
            r"^spread 'entrophy' .*'entropy'",
        ),
    ],
)
def test_unknown_names(settings, message):
    with pytest.raises(UserError, match=message):
        ambiguity_table(random_conditionals(8), settings)
    with pytest.raises(UserError, match=r"^criterion 'pose_ambigity' .*'pose_ambiguity'"):
        tabulate("pose_ambigity", evidence_of(), "average")


def test_coarse_beliefs_are_asked_in_coarse_bins():
    """As more views do."""
    estimate = estimates(6, 360)
    fine = gather_evidence(estimate, SETTINGS, bandwidth_deg=8, pseudo_observations=9, n_bins=72)
    coarse = gather_evidence(estimate, SETTINGS, bandwidth_deg=8, pseudo_observations=9, n_bins=24)
    belief = first_belief(np.array([90.0, 250.0]), fine)
    for criterion in ("pose_ambiguity", *FOR_MORE_VIEWS):
        slow = CRITERIA[criterion](belief, fine, "posterior")[:, ::3]
        fast = CRITERIA[criterion](coarser(belief, coarse), coarse, "posterior")
        for one in range(2):
            assert np.corrcoef(slow[one], fast[one])[0, 1] > 0.9


def test_the_error_of_a_belief_needs_calibration_estimates():
    uniform = np.full((8, 8), 1 / 8)
    evidence = Evidence(np.empty((0, 8)), Conditionals(uniform, uniform), 10, 2, SETTINGS)
    with pytest.raises(ValueError, match=r"^bayes_error needs calibration estimates$"):
        CRITERIA["bayes_error"](every_belief(evidence), evidence, "posterior")


def test_a_table_is_made_once_and_for_each_fusion_where_that_matters():
    evidence = evidence_of()
    made = {
        (criterion, rule): tabulate(criterion, evidence, rule)
        for criterion in ("information_gain", "expected_error")
        for rule in ESTIMATE_FUSIONS
    }
    first, second = ESTIMATE_FUSIONS
    assert made["information_gain", first] is made["information_gain", second]
    assert not np.array_equal(made["expected_error", first], made["expected_error", second])
    for (criterion, rule), table in made.items():
        assert tabulate(criterion, evidence, rule) is table


# Classes of a network, and views of an object.
N_CLASSES, N_VIEWS = 12, 24
AFFINITY = {"power": 4.0, "pseudo_observations": 5.0}


def distributions(seed, n_objects=3, n_views=N_VIEWS):
    """About the true azimuth, some sharp and some wide; rows sum to 1."""
    rng = np.random.default_rng(seed)
    centres = np.arange(N_CLASSES) * (360 / N_CLASSES)
    answer = np.arange(n_views) * (360 / n_views) + rng.normal(0, 40, (n_objects, n_views))
    kappa = rng.uniform(0.3, 4, (n_objects, n_views, 1))
    p = np.exp(kappa * np.cos(np.radians(centres - answer[..., None])))
    return p / p.sum(axis=-1, keepdims=True)


def evidence_of_views(views, **settings):
    return evidence_of_distributions(views, {"affinity": AFFINITY | settings})


def cost_of(criterion, rows, evidence):
    belief = Belief(rows.astype(np.float32), evidence)
    return CRITERIA[criterion](belief, evidence, "product")


def test_the_expected_error_is_the_mean_error_weighted_by_affinity_and_shrunk():
    views, rows = distributions(0), distributions(1).reshape(-1, N_CLASSES)[:5]
    step, rotation_deg = N_VIEWS // N_CLASSES, 360 / N_CLASSES
    expected = np.empty((len(rows), N_CLASSES))
    for delta in range(N_CLASSES):
        weighted, weights, plain = np.zeros(len(rows)), np.zeros(len(rows)), []
        for of_object in views:
            for view in range(0, N_VIEWS, step):
                second = of_object[(view + delta * step) % N_VIEWS]
                pose = product(
                    of_object[view][None], second[None], np.array([delta * rotation_deg])
                )
                error = float(circular_distance_deg(pose, view * 360 / N_VIEWS)[0])
                plain.append(error)
                for index, row in enumerate(rows):
                    weight = 360 / N_CLASSES * np.sum(np.sqrt(row * of_object[view])) ** 4
                    weighted[index] += weight * error
                    weights[index] += weight
        expected[:, delta] = (weighted + 5 * np.mean(plain)) / (weights + 5)
    found = cost_of("expected_error", rows, evidence_of_views(views))
    np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize("n_views", [N_CLASSES, 3 * N_CLASSES])
def test_errors_of_products_are_those_of_fusing_each_pair(n_views):
    """Also where views lie between bins, and where two images exclude each other."""
    views = distributions(2, n_objects=2, n_views=n_views)
    views[0, 3], views[0, 5 * n_views // N_CLASSES + 3] = np.eye(N_CLASSES)[[0, 3]]
    found = rotation_errors_deg(views, evidence_of_views(views), "product")
    assert found.shape == (N_CLASSES, 2, n_views)
    for delta in range(N_CLASSES):
        second = np.roll(views, -delta * (n_views // N_CLASSES), axis=1)
        rotation_deg = np.full((2, n_views), delta * 360.0 / N_CLASSES)
        pose = product(views, second, rotation_deg)
        expected = circular_distance_deg(pose, np.arange(n_views) * (360.0 / n_views))
        np.testing.assert_allclose(found[delta], expected, atol=1e-3)


def test_views_between_the_bins_do_not_count():
    """So kept distributions, a bin apart, lead to the same choices as those of all views."""
    views, rows = distributions(0), distributions(1).reshape(-1, N_CLASSES)[:5]
    every, kept = evidence_of_views(views), evidence_of_views(views[:, :: N_VIEWS // N_CLASSES])
    for criterion in ("expected_error", "fixed"):
        costs = (cost_of(criterion, rows, evidence) for evidence in (every, kept))
        np.testing.assert_allclose(next(costs), next(costs), rtol=1e-6)


def test_without_trust_in_likeness_the_expected_error_is_that_of_the_best_rotation():
    views, rows = distributions(0), distributions(1)[0]
    fixed = cost_of("fixed", rows, evidence_of_views(views))
    assert fixed.shape == (N_VIEWS, N_CLASSES)
    assert np.ptp(fixed, axis=0).max() == 0
    cautious = cost_of("expected_error", rows, evidence_of_views(views, pseudo_observations=1e9))
    np.testing.assert_allclose(cautious, fixed, rtol=1e-4)


@given(st.integers(0, 99), st.integers(1, N_CLASSES - 1))
def test_rotating_every_object_leaves_the_recommended_rotations(seed, k):
    views, rows = distributions(seed), distributions(seed + 100)[0]
    rotated = np.roll(views, (2 * k, k), axis=(1, 2))
    before = cost_of("expected_error", rows, evidence_of_views(views))
    after = cost_of("expected_error", np.roll(rows, k, axis=1), evidence_of_views(rotated))
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
    evidence = replace(evidence_of_views(views), distributions=None)
    with pytest.raises(ValueError, match="'product' needs evidence of distributions"):
        cost_of(criterion, views[0], evidence)


def test_no_policy_is_better_than_the_oracle_of_products():
    views, evidence = distributions(3), evidence_of_views(distributions(0, n_objects=6))
    centres = np.exp(1j * np.radians(np.arange(N_CLASSES) * 30))
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

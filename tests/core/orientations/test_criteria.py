"""The method in three dimensions: enumeration and invariances."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.core.orientations.belief import belief
from nbv.core.orientations.criteria import bayes_error, optimism_deg, view_angle_deg
from nbv.core.orientations.errors import (
    FIXED_STRENGTH,
    SAME_DEG,
    STRENGTHS,
    OrientationErrors,
    ScoreRatio,
    shrinkage,
)
from nbv.core.orientations.group import ASYMMETRIC, Symmetry, viewing_direction

HALF_TURN = Symmetry.from_bop({"symmetries_discrete": [np.diag([-1.0, -1, 1, 1]).ravel()]})
CONE = Symmetry.from_bop({"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]})
IDENTITY = np.eye(3)[None]


def made(symmetry=ASYMMETRIC, n=80, seed=0, **settings):
    """An estimator that is right within 2°, and turned upside down where it looks from +x."""
    rng = np.random.default_rng(seed)
    truth = Rotation.random(n, rng=rng).as_matrix()
    small = Rotation.from_rotvec(rng.normal(0, 2, (n, 3)), degrees=True).as_matrix()
    looks = viewing_direction(truth)
    flips = (symmetry.direction_cosine(looks, np.array([[1.0, 0, 0]]))[:, 0] > 0.5) & (
        rng.random(n) < 0.7
    )
    upside_down = np.where(flips[:, None, None], np.diag([1.0, -1, -1]), np.eye(3))
    return OrientationErrors(truth @ small @ upside_down, truth, symmetry, **settings)


def some_moves(n=6, seed=3):
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix()


@pytest.mark.parametrize("given", ["estimate", "truth"])
@pytest.mark.parametrize("symmetry", [ASYMMETRIC, HALF_TURN, CONE])
def test_conditionals_against_enumeration(symmetry, given):
    """The definition in docs/method.md, pair by pair, with flips of one kind and two odd ones."""
    offsets = Rotation.random(12, rng=np.random.default_rng(5)).as_matrix()
    errors = made(symmetry, concentration=8.0, share=0.3, pseudo_observations=2.0)
    flips = errors.is_flip.nonzero()[0]
    odd = errors.estimate.copy()
    odd[flips[:2]] = Rotation.random(2, rng=np.random.default_rng(6)).as_matrix()
    errors = replace(errors, estimate=odd)
    known, other = (errors.estimate, errors.truth)[:: 1 if given == "estimate" else -1]
    is_odd = np.isin(np.arange(len(known)), flips[:2])
    is_kind = errors.is_flip & ~is_odd
    n, n_kind = len(known), is_kind.sum()
    share = (errors.is_flip.sum() + 2 * 2 * 8 * 0.3) / (n + 2 * 2 * 8)
    assert errors.share_of_flips == pytest.approx(share)
    move = some_moves(1)
    for row, truth in enumerate(offsets):
        seen = symmetry.canonical(move @ truth)[0]
        weight = symmetry.direction_cosine(viewing_direction(seen)[None], viewing_direction(known))
        weight = np.exp(8.0 * (weight[0] - 1))
        # One flip of a kind does not say that there will be another one.
        again = (n_kind - 1) / n_kind
        kind = again * weight[is_kind].sum() + 2 * share * (n_kind - 1) / (n_kind + 3)
        anywhere = weight[errors.is_flip].sum() + 2 * share - kind
        right = weight[~errors.is_flip].sum() + 2 * (1 - share)
        canonical = symmetry.canonical(known[is_kind])
        rotation = symmetry.mean(canonical.mT @ symmetry.nearest(other[is_kind], canonical))
        kernel = np.exp(8.0 * (symmetry.cosine(move.mT @ seen @ rotation, offsets)[0] - 1))
        expected = kind * kernel / kernel.sum() + anywhere / len(offsets)
        expected[row] += right
        found = errors.conditional(given, offsets, move, [row])[0, 0]
        np.testing.assert_allclose(found, expected / expected.sum(), atol=1e-5)


@pytest.mark.parametrize("slope", [None, 0.0, -2.0])
def test_promises_against_enumeration(slope):
    errors, moves = made(), some_moves(3)
    ratio = None if slope is None else ScoreRatio(np.arange(16.0), slope, 0.1)
    shares = np.ones((1, 2)) if ratio is None else ratio.shares(errors.share_of_flips)
    np.testing.assert_allclose(shares.sum(axis=0), 1)
    if ratio is not None:
        # Flips have low scores where the slope is negative; the odds change by the ratio.
        odds = shares[:, 1] / shares[:, 0]
        expected = ratio(ratio.scores[[1, -2]])
        assert odds[0] / odds[-1] == pytest.approx(expected[0] / expected[1])
    first = belief(errors, errors.estimate[:1], IDENTITY)
    b, small = first.probability, errors.small_errors_deg(2)
    found, chances = bayes_error(first, moves, [30], ratio)
    for k, move in enumerate(moves):
        likelihood = errors.conditional("truth", first.support, move[None])[0]
        error = within = 0.0
        for s, (if_right, if_flip) in itertools.product(range(len(b)), shares):
            after = b * likelihood[:, s] * np.where(np.arange(len(b)) == s, if_right, if_flip)
            # The pose is one of two that an estimate supports.
            pose = first.support[s if after[s] > after[0] else 0]
            distance = ASYMMETRIC.distance_deg(first.support, pose)
            error += after @ distance
            within += after @ (distance < 30)
        assert found[k] == pytest.approx(error + small.mean(), abs=1e-4)
        assert chances[0, k] == pytest.approx(within, abs=1e-4)


def answers(errors, estimates, moves):
    """Costs of further moves after the first view, and the pose after all views."""
    first = belief(errors, estimates[:1], IDENTITY)
    costs, _ = bayes_error(first, moves[1:], [5])
    return costs, belief(errors, estimates, moves).pose


@pytest.fixture(params=[ASYMMETRIC, HALF_TURN, CONE])
def case(request):
    errors = made(request.param)
    moves = np.concatenate([IDENTITY, some_moves(3)])
    rng = np.random.default_rng(7)
    truth = Rotation.random(rng=rng).as_matrix()
    estimates = moves @ truth
    estimates[1] = estimates[1] @ np.diag([1.0, -1, -1])
    return errors, estimates, moves


def test_turning_the_world_or_the_camera_turns_every_answer(case):
    errors, estimates, moves = case
    costs, pose = answers(errors, estimates, moves)
    # Camera poses in two worlds that are turned against each other.
    cameras = moves @ some_moves(1, 11)
    there = cameras @ some_moves(1, 12)[0].T
    again, same = answers(errors, estimates, there @ there[0].T)
    np.testing.assert_allclose(again, costs, atol=1e-4)
    np.testing.assert_allclose(same, pose, atol=1e-6)
    # The first camera rolled.
    roll = Rotation.from_rotvec([0, 0, 1.1]).as_matrix()
    rolled = np.concatenate([roll @ estimates[:1], estimates[1:]])
    rotated = np.concatenate([IDENTITY, moves[1:] @ roll.T])
    again, same = answers(errors, rolled, rotated)
    np.testing.assert_allclose(again, costs, atol=1e-4)
    np.testing.assert_allclose(same, roll @ pose, atol=1e-6)


def test_relabelling_a_symmetric_object_changes_nothing(case):
    errors, estimates, moves = case
    costs, pose = answers(errors, estimates, moves)
    rng, group = np.random.default_rng(2), errors.symmetry.discrete
    if errors.symmetry.axis is not None:
        angles = np.radians(np.arange(0, 360, 7.0))[:, None] * errors.symmetry.axis
        group = Rotation.from_rotvec(angles).as_matrix()

    def relabelled(poses):
        return poses @ group[rng.integers(len(group), size=len(poses))]

    other = replace(errors, estimate=relabelled(errors.estimate), truth=relabelled(errors.truth))
    again, same = answers(other, relabelled(estimates), moves)
    np.testing.assert_allclose(again, costs, atol=1e-4)
    assert errors.symmetry.distance_deg(same, pose) < 1e-4


def test_a_view_that_shows_the_flip_is_chosen_and_the_flip_found():
    errors = made(n=400)
    truth = Rotation.align_vectors([[0, 0, -1]], [[1.0, 0, 0]])[0].as_matrix()
    assert viewing_direction(truth) @ [1, 0, 0] > 0.99
    flipped = (truth @ np.diag([1.0, -1, -1]))[None]
    first = belief(errors, flipped, IDENTITY)
    assert first.probability_within(25) < 0.7
    sideways, behind, near = (
        Rotation.from_rotvec([0, angle, 0], degrees=True).as_matrix() for angle in (100, 180, 10)
    )
    moves = np.stack([near, sideways, behind])
    assert np.argmin(bayes_error(first, moves, [5])[0]) > 0
    views = np.concatenate([flipped, (sideways @ truth)[None]])
    both = np.stack([np.eye(3), sideways])
    assert ASYMMETRIC.distance_deg(belief(errors, views, both).pose, truth) < 1
    # A third view that agrees with the flip does not win against one that is sure.
    views = np.concatenate([views, flipped])
    three = np.concatenate([both, near[None]])
    views[2] = near @ flipped[0]
    assert ASYMMETRIC.distance_deg(belief(errors, views, three).pose, truth) < 1


def test_a_score_decides_between_estimates_that_directions_cannot_tell_apart():
    rng = np.random.default_rng(0)
    flips = rng.random(300) < 0.1
    ratio = ScoreRatio.fit(
        np.where(flips, rng.uniform(0, 0.9, 300), rng.uniform(0.5, 1, 300)), flips
    )
    assert ratio([1.0])[0] < 1 < ratio([0.1])[0]
    assert (np.diff(ratio(np.linspace(0, 1, 30))) <= 0).all()
    errors = made()
    pose = some_moves(1, 21)
    views = np.concatenate([pose, pose @ np.diag([1.0, -1, -1])])
    moves = np.stack([np.eye(3)] * 2)
    for scores, expected in (([1.0, 0.2], views[0]), ([0.2, 1.0], views[1])):
        assert (
            ASYMMETRIC.distance_deg(belief(errors, views, moves, ratio(scores)).pose, expected) < 1
        )


def test_scores_say_nothing_without_flips_or_without_anything_else():
    scores = np.linspace(0, 1, 9)
    for flips in (np.zeros(9, bool), np.ones(9, bool)):
        np.testing.assert_allclose(ScoreRatio.fit(scores, flips)(scores), 1)


def test_scores_by_chance_say_nothing_in_most_tables():
    """A gain of 2 nats by one parameter has a probability of 4.6 % (Wilks)."""
    rng = np.random.default_rng(0)
    slopes = [ScoreRatio.fit(rng.random(200), rng.random(200) < 0.2).slope for _ in range(300)]
    assert 0.02 < np.count_nonzero(slopes) / 300 < 0.08


def test_the_strength_of_the_shrinkage_is_the_likeliest():
    """By the definition, each group left out, group by group and pair by pair."""
    objects = [made(n=60, seed=1, group=np.arange(60) % 5), made(CONE, 40, 2, group=np.ones(40))]
    rows = [(k, group) for k, each in enumerate(objects) for group in np.unique(each.group)]
    likelihood = np.zeros((len(STRENGTHS), len(rows)))
    for i, strength in enumerate(STRENGTHS):
        for j, (k, group) in enumerate(rows):
            kept = [
                (each.is_flip, np.ones(60, bool)[: len(each.group)])
                if each is not objects[k]
                else (each.is_flip, each.group != group)
                for each in objects
            ]
            flips = sum(f[rest].sum() for f, rest in kept)
            share = (flips + 0.5) / (sum(rest.sum() for _, rest in kept) + 1)
            rest = objects[k].group != group
            others = replace(
                objects[k],
                estimate=objects[k].estimate[rest],
                truth=objects[k].truth[rest],
                share=share,
                pseudo_observations=strength,
            )
            seen, known = map(viewing_direction, (objects[k].estimate, others.estimate))
            weight = np.exp(25 * (objects[k].symmetry.direction_cosine(seen[~rest], known) - 1))
            p = weight @ others.is_flip + strength * others.share_of_flips
            p /= weight.sum(axis=1) + strength
            likelihood[i, j] = np.log(np.where(objects[k].is_flip[~rest], p, 1 - p)).sum()
    assert shrinkage(objects) == STRENGTHS[likelihood.sum(axis=1).argmax()]


def test_calibration_shows_whether_flips_depend_on_the_view():
    rng = np.random.default_rng(4)
    dependent = made(n=600, group=np.arange(600) % 4)
    assert shrinkage([dependent]) < STRENGTHS[-1]
    flips = np.where((rng.random(600) < 0.15)[:, None, None], np.diag([1.0, -1, -1]), np.eye(3))
    chance = replace(dependent, estimate=dependent.truth @ flips)
    assert shrinkage([chance]) == STRENGTHS[-1]
    # Then every candidate promises about the same.
    chance = replace(chance, pseudo_observations=STRENGTHS[-1])
    costs, _ = bayes_error(belief(chance, flips[:1], IDENTITY), some_moves(20), [5])
    assert np.ptp(costs) < 0.05 * costs.mean()
    assert shrinkage([replace(dependent, group=np.zeros(600))]) == FIXED_STRENGTH


def test_the_least_is_raised_by_what_halves_of_the_groups_lose_to_each_other():
    group = np.arange(1600) // 50
    errors = made(n=1600, group=group, pseudo_observations=0.3)
    anywhere = np.random.default_rng(9).random((1600, 1, 1)) < 0.06
    flips = np.where(anywhere, np.diag([1.0, -1, -1]), np.eye(3))
    errors = replace(errors, estimate=errors.estimate @ flips)
    truth = Rotation.align_vectors([[0, 0, -1]], [[1.0, 0, 0]])[0].as_matrix()
    first = belief(errors, (truth @ np.diag([1.0, -1, -1]))[None], IDENTITY)
    moves = some_moves(12)

    def costs(**others):
        return bayes_error(replace(first, errors=replace(errors, **others)), moves, [30.0])[0]

    cost = costs()
    raised = cost.min() - costs(pseudo_observations=0.01)[cost.argmin()]
    halves = [group % 2 == k for k in (0, 1)]
    a, b = (
        costs(estimate=errors.estimate[k], truth=errors.truth[k], group=group[k]) for k in halves
    )
    lost = (a[b.argmin()] - a.min() + b[a.argmin()] - b.min()) / 2
    assert optimism_deg(first, moves, cost) == pytest.approx(lost / 2**0.5 - raised, abs=0.05)
    assert lost / 2**0.5 > raised
    independent = replace(first, errors=replace(errors, pseudo_observations=STRENGTHS[-1]))
    assert optimism_deg(independent, moves, cost) == 0


def test_a_pose_is_held_once_in_the_support():
    errors = made(n=200)
    pose = some_moves(1, 21)
    views = np.concatenate([pose, pose @ np.diag([1.0, -1, -1])])
    support = belief(errors, views, np.stack([np.eye(3)] * 2)).support
    cosine = ASYMMETRIC.cosine(support, support) - 2 * np.eye(len(support))
    assert cosine.max() < np.cos(np.radians(SAME_DEG)) + 1e-9


@pytest.mark.parametrize("correlation", [0.0, 1.0])
def test_the_mean_of_several_views_has_smaller_errors_unless_they_are_the_same(correlation):
    rng = np.random.default_rng(3)
    truth = Rotation.random(3000, rng=rng)
    error = rng.normal(0, 2, (300, 10, 3))
    if correlation:
        error[:] = error[:, :1]
    small = Rotation.from_rotvec(error.reshape(-1, 3), degrees=True)
    group = np.repeat(np.arange(300), 10)
    errors = OrientationErrors((truth * small).as_matrix(), truth.as_matrix(), group=group)
    mean = np.linalg.norm(error.mean(axis=1), axis=1).mean()
    assert errors.small_errors_deg(10).mean() == pytest.approx(mean, rel=0.05)


def test_the_angle_of_a_move_is_that_between_the_directions():
    angles_deg = np.array([30, 170, 90])
    moves = Rotation.from_rotvec(angles_deg[:, None] * [0, 1, 0], degrees=True).as_matrix()
    np.testing.assert_allclose(view_angle_deg(moves), angles_deg, atol=1e-6)


def test_the_probability_to_be_within_an_error_counts_small_errors():
    errors = made(n=300)
    opposite = Rotation.align_vectors([[0, 0, -1]], [[-1.0, 0, 0]])[0].as_matrix()[None]
    sure = belief(errors, opposite, IDENTITY)
    small = errors.error_deg[~errors.is_flip]
    assert sure.probability_within(2.0) == pytest.approx((small < 2).mean(), rel=0.1)
    chances = [sure.probability_within(deg) for deg in (1, 5, 15, 30, 200)]
    assert chances == sorted(chances)
    assert chances[-1] == pytest.approx(1)

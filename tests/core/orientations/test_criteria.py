"""The method in three dimensions: the circle as a special case, invariances, enumeration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.core.circle import belief as circle_belief
from nbv.core.circle import criteria, fusion
from nbv.core.circle.angles import circular_distance_deg, direction_deg
from nbv.core.circle.density import von_mises_kernel
from nbv.core.circle.evidence import gather_evidence
from nbv.core.orientations.belief import average, belief, posterior
from nbv.core.orientations.criteria import CRITERIA, NextViews, costs_of, ranking, view_angle_deg
from nbv.core.orientations.errors import OrientationErrors, ScoreRatio
from nbv.core.orientations.group import ASYMMETRIC, Symmetry, viewing_direction
from nbv.errors import UserError

N_BINS, BANDWIDTH_DEG, ALPHA = 36, 12.0, 4.0
BINS_DEG = np.arange(N_BINS) * (360.0 / N_BINS)
CAMERA = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])  # level, at azimuth 0
HALF_TURN = Symmetry.from_bop({"symmetries_discrete": [np.diag([-1.0, -1, 1, 1]).ravel()]})
CONE = Symmetry.from_bop({"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]})
IDENTITY = np.eye(3)[None]


def at(azimuth_deg):
    """The poses of an object that a level camera sees at azimuths."""
    turns = Rotation.from_euler("z", -np.ravel(azimuth_deg)[:, None], degrees=True)
    return CAMERA @ turns.as_matrix()


def moves_by(delta_deg):
    return at(delta_deg) @ CAMERA.T


@pytest.fixture(scope="module")
def circle():
    """An estimator that is blind around 90°, on the circle and as rotations about one axis."""
    rng = np.random.default_rng(0)
    blind = np.where(circular_distance_deg(BINS_DEG, 90) < 50, 90.0, BINS_DEG)
    estimate_deg = (blind + 10 * rng.integers(-1, 2, (3, N_BINS))) % 360
    settings = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    density = {"bandwidth_deg": BANDWIDTH_DEG, "pseudo_observations": ALPHA, "n_bins": N_BINS}
    evidence = gather_evidence(estimate_deg, settings, **density)
    # Pairs weigh 1 at the kernel's centre, and there a part of 1 on the circle.
    alpha = ALPHA * 360 / N_BINS / von_mises_kernel(N_BINS, BANDWIDTH_DEG)[0]
    errors = OrientationErrors(
        at(estimate_deg),
        at(np.tile(BINS_DEG, 3)),
        concentration=1 / np.radians(BANDWIDTH_DEG) ** 2,
        pseudo_observations=alpha,
        flip_deg=0,
        offsets=CAMERA.T @ at(BINS_DEG),
    )
    return evidence, errors


def test_about_one_axis_v_and_l_are_the_circles(circle):
    evidence, errors = circle
    pair, support = evidence.conditionals, at(BINS_DEG)
    v, l_ = (errors.conditional(given, support)[0] for given in ("estimate", "truth"))
    np.testing.assert_allclose(v, pair.viewpoint, atol=2e-5)
    np.testing.assert_allclose(l_, pair.estimate, atol=2e-5)


def test_about_one_axis_costs_and_choices_are_the_circles(circle):
    evidence, errors = circle
    v, l_ = evidence.conditionals.viewpoint, evidence.conditionals.estimate
    moves = moves_by(BINS_DEG)
    for e in (3, 9, 22):
        first = belief(errors, at(BINS_DEG[e]), IDENTITY)
        on_circle = circle_belief.first_belief(BINS_DEG[[e]], evidence)
        for name in ("pose_ambiguity", "information_gain"):
            cost = costs_of(name, NextViews(first, moves))
            expected = criteria.CRITERIA[name](on_circle, evidence, "posterior")[0]
            np.testing.assert_allclose(cost, expected, atol=2e-5)
            best = ranking(cost, view_angle_deg(moves))[0]
            assert expected[best] <= expected.min() + 2e-5
            if np.sort(expected)[1] > expected.min() + 1e-4:
                assert best == expected.argmin()
        # The expected error of the posterior mean direction.
        unit = np.exp(1j * np.radians(BINS_DEG))
        for delta in (0, 7, 18):
            joint = v[e][:, None] * np.roll(l_, -delta, axis=0)
            moment = unit @ joint
            error = circular_distance_deg(
                direction_deg(moment.real, moment.imag), BINS_DEG[:, None]
            )
            cost = costs_of("bayes_error", NextViews(first, moves[[delta]]))
            assert cost[0] == pytest.approx((joint * error).sum(), abs=2e-2)


def test_about_one_axis_fused_poses_are_the_circles(circle):
    evidence, errors = circle
    rng = np.random.default_rng(1)
    for e1, e2, delta in BINS_DEG[rng.integers(N_BINS, size=(30, 3))]:
        views = np.concatenate([at(e1), at(e2)]), np.concatenate([IDENTITY, moves_by(delta)])
        for ours, theirs in ((average, fusion.average), (posterior, fusion.posterior)):
            expected = theirs(e1, e2, delta, evidence)
            assert ASYMMETRIC.distance_deg(ours(errors, *views), at(expected)[0]) < 0.05


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
@pytest.mark.parametrize("flip_deg", [0.0, 20.0])
@pytest.mark.parametrize("symmetry", [ASYMMETRIC, HALF_TURN])
def test_conditionals_against_enumeration(symmetry, flip_deg, given):
    """The definition in docs/method.md, pair by pair, with the roll found by trial."""
    offsets = Rotation.random(12, rng=np.random.default_rng(5)).as_matrix()
    errors = made(
        symmetry,
        n=25,
        flip_deg=flip_deg,
        offsets=offsets,
        concentration=8.0,
        pseudo_observations=10.0,
    )
    support, move = offsets, some_moves(1)
    known, other = (errors.estimate, errors.truth)[:: 1 if given == "estimate" else -1]
    n, m = len(known), len(support)
    share = (errors.is_flip.sum() + 0.5) / (n + 1) if flip_deg else 1.0
    angles = np.radians(np.arange(0, 360, 0.5))[:, None] * [0, 0, 1]
    rolls = Rotation.from_rotvec(angles).as_matrix()
    expected = np.zeros((m, m))
    flips = list(zip(known[errors.is_flip], other[errors.is_flip], strict=True))
    for row, pose, seen in zip(expected, support, move @ support, strict=True):
        anywhere = np.full(m, 1 / m)  # one flip that leads anywhere
        for a, b in flips if flip_deg else ():
            there = symmetry.canonical(pose[None]) @ symmetry.canonical(a[None]).mT @ b
            kernel = np.exp(8.0 * (symmetry.cosine(there, support)[0] - 1))
            anywhere += kernel / kernel.sum()
        row += 10.0 * share * anywhere / anywhere.sum()
        right = 10.0 * (1 - share)
        for a, b, flip in zip(known, other, errors.is_flip, strict=True):
            alike = rolls[:, None] @ (a @ symmetry.discrete)
            trace = np.einsum("ij,rgij->rg", seen, alike)
            r, g = np.unravel_index(trace.argmax(), trace.shape)
            cosine = -seen[2] @ -(a @ symmetry.discrete[g])[2]
            weight = np.exp(8.0 * (cosine - 1))
            if flip and weight > 1e-3:
                there = move.mT @ rolls[r] @ b
                kernel = np.exp(8.0 * (symmetry.cosine(there, support)[0] - 1))
                row += weight * kernel / kernel.sum()
            elif not flip:
                right += weight
        index = next(i for i in range(m) if np.allclose(move[0] @ support[i], seen))
        row[index] += right
        row /= row.sum()
    found = errors.conditional(given, support, move)[0]
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize("flip_deg", [0.0, 20.0])
def test_costs_against_enumeration(flip_deg):
    offsets = np.concatenate(
        [IDENTITY, Rotation.random(9, rng=np.random.default_rng(5)).as_matrix()]
    )
    errors, moves = made(flip_deg=flip_deg, offsets=offsets), some_moves(3)
    first = belief(errors, errors.estimate[:1], IDENTITY)
    b, m = first.probability, len(offsets)
    for k, move in enumerate(moves):
        v = [errors.conditional("estimate", first.support, x)[0] for x in (IDENTITY, move[None])]
        l_ = errors.conditional("truth", first.support, move[None])[0]
        entropy = lambda p: -np.sum(p[p > 0] * np.log(p[p > 0]))  # noqa: E731
        gain = error = 0.0
        for s in range(m):
            after = b * l_[:, s]
            gain += after.sum() * entropy(after / after.sum())
            views = np.stack([errors.estimate[0], move @ first.support[s]])
            pose = posterior(errors, views, np.concatenate([IDENTITY, move[None]]))
            error += after @ ASYMMETRIC.distance_deg(first.support, pose)
        poses = [v[0][p] * v[1][p] for p in range(m)]
        ambiguity = entropy(sum(b[p] * pose / pose.sum() for p, pose in enumerate(poses)))
        costs = [CRITERIA[name](NextViews(first, moves))[k] for name in CRITERIA]
        assert costs[:2] == pytest.approx([ambiguity, gain], abs=1e-5)
        if not flip_deg:  # with flips the pose is one of two, which `posterior` finds on its own
            assert costs[2] == pytest.approx(error, abs=1e-2)


def answers(errors, estimates, moves):
    """Costs of further moves after the first view, and the pose after all views."""
    first = belief(errors, estimates[:1], IDENTITY)
    costs = [costs_of(name, NextViews(first, moves[1:])) for name in CRITERIA]
    return np.concatenate(costs), posterior(errors, estimates, moves)


@pytest.fixture(params=[(ASYMMETRIC, 20), (HALF_TURN, 20), (CONE, 20), (HALF_TURN, 0)])
def case(request):
    symmetry, flip_deg = request.param
    errors = made(symmetry, flip_deg=flip_deg)
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

    other = replace(
        errors,
        estimate=relabelled(errors.estimate),
        truth=relabelled(errors.truth),
        offsets=None,
    )
    again, same = answers(other, relabelled(estimates), moves)
    np.testing.assert_allclose(again, costs, atol=1e-4)
    assert errors.symmetry.distance_deg(same, pose) < 1e-4


def test_a_view_that_shows_the_flip_is_chosen_and_the_flip_found():
    errors = made(n=400)
    truth = Rotation.align_vectors([[0, 0, -1]], [[1.0, 0, 0]])[0].as_matrix()
    assert viewing_direction(truth) @ [1, 0, 0] > 0.99
    flipped = (truth @ np.diag([1.0, -1, -1]))[None]
    assert errors.flip_probability(flipped, "estimate")[0] > 0.3
    first = belief(errors, flipped, IDENTITY)
    sideways, behind, near = (
        Rotation.from_rotvec([0, angle, 0], degrees=True).as_matrix() for angle in (100, 180, 10)
    )
    moves = np.stack([near, sideways, behind])
    for name in ("information_gain", "bayes_error"):
        assert np.argmin(costs_of(name, NextViews(first, moves))) > 0
    views = np.concatenate([flipped, (sideways @ truth)[None]])
    both = np.stack([np.eye(3), sideways])
    assert ASYMMETRIC.distance_deg(posterior(errors, views, both), truth) < 1
    # A third view that agrees with the flip does not win against one that is sure.
    views = np.concatenate([views, flipped])
    three = np.concatenate([both, near[None]])
    views[2] = near @ flipped[0]
    assert ASYMMETRIC.distance_deg(posterior(errors, views, three), truth) < 1


@pytest.mark.parametrize("scored", [False, True])
def test_the_fused_pose_is_the_beliefs(scored):
    errors = made(HALF_TURN)
    ratio = ScoreRatio(np.linspace(0, 1, 9), -1.0, 0.0)
    errors = replace(errors, ratio=ratio)
    rng, flipped = np.random.default_rng(8), [np.eye(3), np.diag([1.0, -1, -1])]
    for n_views in (2, 3, 3, 3):
        moves = np.concatenate([IDENTITY, some_moves(n_views - 1, n_views)])
        flips = np.stack([flipped[k] for k in rng.integers(2, size=n_views)])
        views = moves @ Rotation.random(rng=rng).as_matrix() @ flips
        given = errors, views, moves, rng.random(n_views) if scored else None
        np.testing.assert_allclose(posterior(*given), belief(*given).pose, atol=1e-9)


def test_a_score_decides_between_estimates_that_directions_cannot_tell_apart():
    rng = np.random.default_rng(0)
    flips = rng.random(300) < 0.1
    ratio = ScoreRatio.fit(
        np.where(flips, rng.uniform(0, 0.9, 300), rng.uniform(0.5, 1, 300)), flips
    )
    assert ratio([1.0])[0] < 1 < ratio([0.1])[0]
    assert (np.diff(ratio(np.linspace(0, 1, 30))) <= 0).all()
    errors = replace(made(), ratio=ratio)
    pose = some_moves(1, 21)
    views = np.concatenate([pose, pose @ np.diag([1.0, -1, -1])])
    moves = np.stack([np.eye(3)] * 2)
    for scores, expected in (([1.0, 0.2], views[0]), ([0.2, 1.0], views[1])):
        assert ASYMMETRIC.distance_deg(posterior(errors, views, moves, scores), expected) < 1


def test_scores_say_nothing_without_flips_or_without_anything_else():
    scores = np.linspace(0, 1, 9)
    for flips in (np.zeros(9, bool), np.ones(9, bool)):
        np.testing.assert_allclose(ScoreRatio.fit(scores, flips)(scores), 1)


def test_calibration_shows_whether_flips_depend_on_the_view():
    rng = np.random.default_rng(4)
    dependent = made(n=600)
    groups = np.arange(600) % 4
    assert dependent.depends_on_view(groups)
    flips = np.where((rng.random(600) < 0.15)[:, None, None], np.diag([1.0, -1, -1]), np.eye(3))
    chance = replace(dependent, estimate=dependent.truth @ flips, offsets=None)
    assert not chance.depends_on_view(groups)
    assert not dependent.depends_on_view(np.zeros(600))


def test_of_equal_costs_the_shortest_way_is_first():
    angles_deg = np.array([30, 170, 90])
    moves = Rotation.from_rotvec(angles_deg[:, None] * [0, 1, 0], degrees=True).as_matrix()
    np.testing.assert_allclose(view_angle_deg(moves), angles_deg, atol=1e-6)
    assert ranking(np.array([1.0, 1e-12, 0.0]), view_angle_deg(moves)).tolist() == [2, 1, 0]


def test_the_probability_to_be_within_an_error_counts_small_errors():
    errors = made(n=300)
    opposite = Rotation.align_vectors([[0, 0, -1]], [[-1.0, 0, 0]])[0].as_matrix()[None]
    sure = belief(errors, opposite, IDENTITY)
    small = errors.error_deg[~errors.is_flip]
    assert sure.probability_within(2.0) == pytest.approx((small < 2).mean(), rel=0.1)
    chances = [sure.probability_within(deg) for deg in (1, 5, 15, 30, 200)]
    assert chances == sorted(chances)
    assert chances[-1] == pytest.approx(1)


def test_ambiguity_is_refused_after_two_views():
    errors = made(n=10)
    two = belief(errors, errors.estimate[:2], np.concatenate([IDENTITY, some_moves(1)]))
    with pytest.raises(ValueError, match="two views, not 3"):
        costs_of("pose_ambiguity", NextViews(two, some_moves(2)))
    assert np.isfinite(costs_of("bayes_error", NextViews(two, some_moves(2)))).all()


def test_an_unknown_criterion_is_named():
    errors = made(n=10)
    ahead = NextViews(belief(errors, errors.estimate[:1], IDENTITY), IDENTITY)
    with pytest.raises(UserError, match="criterion 'entropi' is unknown"):
        costs_of("entropi", ahead)

"""Errors after a further view against a brute force, and against the criterion of two views."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import isotonic_regression

from made_estimates import product_by_loops, sharp_sweeps, unclear_sweeps
from nbv.core.alike.compare import WITHIN_DEG, CalibrationViews, compared_step, first_bins
from nbv.core.alike.expected import Expected, expected_errors
from nbv.core.alike.reliability import N_GROUPS, observed_error
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief
from nbv.core.circle.criteria import expected_error
from nbv.core.circle.distributions import (
    log_bayes_factor,
    mean_direction_deg,
    product_directions_deg,
)
from nbv.core.circle.evidence import evidence_of_distributions
from nbv.core.circle.fusion import product

SETTINGS = {"affinity": {"power": 5.0, "pseudo_observations": 30.0}}


def random_sweeps(rng: np.random.Generator, n: int = 3, bins: int = 24) -> np.ndarray:
    logits = rng.normal(0.0, 2.0, (n, bins, bins))
    return np.exp(logits) / np.exp(logits).sum(axis=-1, keepdims=True)


def expected_of(
    known: CalibrationViews, beliefs: np.ndarray, *options: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the expected errors now, and after a view at every rotation, of beliefs (n, B)."""
    found = [expected_errors(known, belief, *options) for belief in beliefs]
    return np.array([one.now_deg for one in found]), np.stack([one.after_deg for one in found])


def errors_of(known: CalibrationViews) -> np.ndarray:
    """Return the errors after a view at each rotation, and now, (S, K, M + 1)."""
    return known.outcomes[..., : known.roots.shape[2] + 1]


def share_of(known: CalibrationViews, agreement: float = 0.0) -> np.ndarray:
    """How much each sequence of views counts for one with a log Bayes factor."""
    apart = np.minimum(known.agreement, 0.0) - min(agreement, 0.0)
    return np.exp(-0.5 * apart.astype(np.float64) ** 2)


@pytest.mark.parametrize("n_sweeps", [3, 30])
def test_after_one_view_it_is_the_criterion(rng: np.random.Generator, n_sweeps: int) -> None:
    """However many sweeps there are: after one view, all first views count."""
    distributions = random_sweeps(rng, n_sweeps)
    evidence = evidence_of_distributions(distributions, SETTINGS)
    rows = random_sweeps(rng)[0].astype(np.float32)
    wanted = expected_error(Belief(rows, evidence), evidence, "product")
    known = CalibrationViews.of_sweeps(distributions)
    _, found = expected_of(known, rows, 5.0, 30.0)
    assert found == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("n_views", [1, 2])
def test_where_nothing_is_alike_and_nothing_is_added_the_mean_of_all_is_expected(rng, n_views):
    """A power so large that all weights are 0: no NaN."""
    known = CalibrationViews.of_sweeps(random_sweeps(rng))
    known = known if n_views == 1 else known.after(7)
    (now,), (after,) = expected_of(known, random_sweeps(rng)[0][:1], 1e5, 0.0)
    (wanted_now,), (wanted,) = expected_of(known, random_sweeps(rng)[0][:1], 5.0, 1e12)
    assert now == pytest.approx(wanted_now, rel=1e-5)
    assert after == pytest.approx(wanted, rel=1e-5)


def test_errors_after_three_views_are_those_of_the_product(rng: np.random.Generator) -> None:
    distributions, bins, first = random_sweeps(rng), 24, 5
    known = CalibrationViews.of_sweeps(distributions).after(3).after(10)
    rotations = np.array([0, 3, 10])
    own = product_by_loops(distributions[1, (first + rotations) % bins], rotations)
    own /= own.sum()
    assert known.fused[1, first] == pytest.approx(own, rel=1e-4)
    for rotation in range(bins):
        other = distributions[1, (first + rotation) % bins]
        pose = product(own, other, 15.0 * rotation)
        wanted = circular_distance_deg(pose, 15.0 * first)
        assert errors_of(known)[1, first, rotation] == pytest.approx(wanted, abs=0.05)
    assert errors_of(known)[..., -1] == pytest.approx(known.error_now_deg, abs=1e-3)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 6), n_further=st.integers(1, 6))
def test_directions_of_products_are_those_of_each_pair(seed: int, n: int, n_further: int) -> None:
    rng = np.random.default_rng(seed)
    so_far, further = rng.dirichlet(np.ones(24), n), rng.dirichlet(np.ones(24), n_further)
    found = product_directions_deg(so_far, further, 90.0)
    assert found.shape == (n, n_further)
    for i, j in np.ndindex(found.shape):
        wanted = mean_direction_deg((so_far[i] * further[j])[None])[0]
        assert circular_distance_deg(found[i, j], wanted) == pytest.approx(0.0, abs=1e-6)


def test_a_product_without_a_direction_has_the_other_one() -> None:
    halves = np.eye(24)[[0, 12]].sum(axis=0)[None] / 2
    rest = np.eye(24)[[5]]
    assert product_directions_deg(halves, halves, 90.0).item() == 90.0
    assert product_directions_deg(halves, rest, [[45.0]]).item() == 45.0


@pytest.mark.parametrize(
    ("bins", "step"), [(24, 1), (60, 1), (72, 1), (90, 1), (120, 2), (180, 3), (360, 6), (210, 3)]
)
def test_finer_bins_are_compared_at_six_degrees_at_most(bins: int, step: int) -> None:
    assert compared_step(bins) == step


@given(
    n_sweeps=st.integers(1, 200),
    n_bins=st.sampled_from([7, 24, 90, 120]),
    most=st.integers(1, 30_000),
)
def test_first_views_are_evenly_apart_and_everywhere(n_sweeps: int, n_bins: int, most: int) -> None:
    first = first_bins(n_sweeps, n_bins, most)
    of_sweep = first.shape[1]
    apart = np.diff(first, axis=1, append=first[:, :1] + n_bins)
    assert np.all(apart == n_bins / of_sweep)
    assert first.size <= max(most, n_sweeps)
    # No divisor of a full turn would have more.
    finer = [n for n in range(of_sweep + 1, n_bins + 1) if n_bins % n == 0]
    assert all(n_sweeps * n > most for n in finer)
    for place in range(n_bins):
        if n_sweeps * of_sweep >= n_bins:
            assert place in first


def test_without_a_limit_every_view_is_a_first_one() -> None:
    assert np.array_equal(first_bins(3, 24), np.tile(np.arange(24), (3, 1)))


@pytest.mark.parametrize(("n_bins", "most"), [(24, 500), (24, 40), (24, 12), (15, 15), (30, 3)])
def test_errors_near_first_views_are_those_within_half_the_way(
    rng: np.random.Generator, n_bins: int, most: int
) -> None:
    distributions = random_sweeps(rng, bins=n_bins)
    errors = errors_of(CalibrationViews.of_sweeps(distributions))
    fewer = CalibrationViews.of_sweeps(distributions, most)
    found, apart = errors_of(fewer), n_bins // fewer.first.shape[1]
    for sweep, places in enumerate(fewer.first):
        for row, place in enumerate(places):
            # Half a bin at a time, so that a bin that two share is counted once by each.
            ways = (2 * place + np.arange(-apart + 0.5, apart)) / 2
            near = errors[sweep, np.round(ways).astype(int) % n_bins]
            assert found[sweep, row] == pytest.approx(near.mean(axis=0), rel=1e-4)


@pytest.mark.parametrize(
    ("n_bins", "most"), [(24, 40), (24, 12), (90, 55), (120, 100), (180, 270), (180, 72)]
)
def test_fewer_first_views_are_the_same_views(
    rng: np.random.Generator, n_bins: int, most: int
) -> None:
    """After further views their distributions and errors are those of the same views among all."""
    distributions = random_sweeps(rng, bins=n_bins)
    everything = CalibrationViews.of_sweeps(distributions).after(5)
    fewer = CalibrationViews.of_sweeps(distributions, most).after(5)
    assert fewer.first.size <= most
    rows = np.arange(3)[:, None], fewer.first
    assert fewer.fused == pytest.approx(everything.fused[rows], rel=1e-6)
    assert errors_of(fewer) == pytest.approx(errors_of(everything)[rows], abs=0.01)


@pytest.mark.parametrize("rotations", [[], [5], [5, 17]])
def test_expected_errors_of_fewer_first_views_are_means_by_affinity(
    rng: np.random.Generator, rotations: list[int]
) -> None:
    """Of the errors of all views near each one, or of its own after further views."""
    distributions, belief = random_sweeps(rng), random_sweeps(rng)[0, :2]
    everything = CalibrationViews.of_sweeps(distributions)
    fewer = CalibrationViews.of_sweeps(distributions, most=40)
    for rotation in rotations:
        everything, fewer = everything.after(rotation), fewer.after(rotation)
    assert fewer.first.tolist() == [[k + 2 * n for n in range(12)] for k in (0, 1, 0)]
    rows = np.arange(3)[:, None], fewer.first
    errors = errors_of(everything)[rows] if rotations else errors_of(fewer)
    now, after = expected_of(fewer, belief, 5.0, 30.0)
    for own, own_now, own_after in zip(belief, now, after, strict=True):
        weight = 30.0 * (np.sqrt(everything.fused[rows]) @ np.sqrt(own)) ** 5.0 * share_of(fewer)
        weight += 30.0 / weight.size
        wanted = np.tensordot(weight / weight.sum(), errors)
        assert own_after == pytest.approx(wanted[:-1], rel=1e-4)
        assert own_now == pytest.approx(wanted[-1], rel=1e-4)


def test_in_fine_bins_the_expected_error_is_that_of_joined_ones(rng: np.random.Generator) -> None:
    """In bins of 3 degrees: affinities of pairs of bins, and errors linear between whole steps."""
    distributions, beliefs = random_sweeps(rng, 2, 120), random_sweeps(rng, 1, 120)[0, :2]
    known = CalibrationViews.of_sweeps(distributions).after(7)
    now, after = expected_of(known, beliefs, 5.0, 30.0)
    views = np.concatenate(known.fused)
    errors = np.concatenate(errors_of(known)[..., :-1])
    for belief, own_now, own in zip(beliefs, now, after, strict=True):
        pairs = [np.sqrt(rows[..., ::2] + rows[..., 1::2]) for rows in (belief, views)]
        weight = 3.0 * (pairs[1] @ pairs[0]) ** 5.0 * share_of(known).ravel()
        total = weight.sum() + 30.0
        wanted = (weight @ errors + 30.0 * errors.mean(axis=0)) / total
        assert own[::2] == pytest.approx(wanted, rel=1e-4)
        assert own[1::2] == pytest.approx((wanted + np.roll(wanted, -1)) / 2, rel=1e-4)
        error_now = np.concatenate(known.error_now_deg)
        wanted_now = (weight @ error_now + 30.0 * error_now.mean()) / total
        assert own_now == pytest.approx(wanted_now, rel=1e-4)


@pytest.mark.parametrize("sharpness", [1.0, 6.0, 20.0])
def test_what_is_left_out_hardly_counts(rng: np.random.Generator, sharpness: float) -> None:
    """After two views: sums over all first views, but 400 at most for the pseudo-observations."""
    distributions = sharp_sweeps(rng, 20, sharpness)
    known = CalibrationViews.of_sweeps(distributions).after(5)
    share = rng.uniform(0.1, 1, 20)
    belief = product_by_loops(distributions[3, [7, 12]], [0, 5])
    belief /= belief.sum()
    weight = 15.0 * (np.sqrt(known.fused) @ np.sqrt(belief)) ** 16.0
    weight *= share[:, None] * share_of(known)
    errors = errors_of(known)
    averaged = errors[np.arange(20)[:, None], first_bins(20, 24, 400)].mean(axis=1)
    averaged[:, -1] = errors[..., -1].mean(axis=1)
    mean = share @ averaged / share.sum()
    wanted = (np.tensordot(weight, errors) + 30.0 * mean) / (weight.sum() + 30.0)
    found = expected_errors(known, belief, 16.0, 30.0, share)
    assert found.now_deg == pytest.approx(wanted[-1], rel=1e-3)
    assert found.after_deg == pytest.approx(wanted[:-1], rel=1e-3)
    assert averaged.mean(axis=0) == pytest.approx(errors.mean(axis=(0, 1)), rel=0.1)


def of_objects(
    errors: np.ndarray, prior: np.ndarray, weight: float, now: np.ndarray | float = 0.0
) -> Expected:
    """What weighted errors (O, M) of objects of equal weight lead one to expect."""
    n_objects, n_steps = errors.shape
    by_object = np.column_stack(
        [errors, np.broadcast_to(now, n_objects), np.full(n_objects, weight / n_objects)]
    )
    return Expected(
        now_deg=0.0,
        after_deg=np.zeros(n_steps),
        within_now=np.zeros(3),
        within_after=np.zeros((3, n_steps)),
        by_object=by_object,
        total=by_object.sum(axis=0) + np.append(prior, [0.0, 0.0]),
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    n_parts=st.integers(1, 5),
    steps=st.lists(st.integers(0, 11), min_size=1, max_size=12),
)
def test_a_choice_is_never_pessimistic(seed: int, n_parts: int, steps: list[int]) -> None:
    rng = np.random.default_rng(seed)
    expected = of_objects(rng.gamma(1.0, 1.0, (n_parts, 12)), rng.gamma(1.0, 0.2, 12), 20.0)
    more = expected.optimism_deg(np.isin(np.arange(12), steps))
    assert more >= -1e-12
    if n_parts == 1 or len(set(steps)) == 1:
        assert more == 0.0


def test_the_least_of_uncertain_errors_and_its_optimism_are_right_on_average() -> None:
    """All rotations err by 10 degrees, but no error is known well."""
    rng, least, raised = np.random.default_rng(0), [], []
    every = np.ones(60, dtype=bool)
    for _ in range(2000):
        sums = rng.normal(10.0, 2.0, (5, 60))
        least.append(sums.mean(axis=0).min())
        raised.append(least[-1] + of_objects(sums, np.zeros(60), 5.0).optimism_deg(every))
    assert np.mean(least) < 8.5
    assert np.mean(raised) == pytest.approx(10.0, abs=0.1)


def test_where_one_rotation_is_best_for_all_objects_nothing_is_added() -> None:
    sums = 10.0 - 8.0 * (np.arange(12) == 7) + np.zeros((5, 12))
    assert of_objects(sums, np.zeros(12), 5.0).optimism_deg(np.ones(12, dtype=bool)) == 0.0


@pytest.mark.parametrize("power", [0.0, 0.01, 1.0, 16.0, 64.0, 200.0, 3000.0])
@pytest.mark.parametrize("rotations", [[], [5]])
def test_the_least_weights_count_as_they_are(
    rng: np.random.Generator, power: float, rotations: list[int]
) -> None:
    """Whatever the power: those that are no normal number in single precision count nothing."""
    distributions = sharp_sweeps(rng, 5, 6.0)
    known, belief = CalibrationViews.of_sweeps(distributions), distributions[2, 3]
    for rotation in rotations:
        known = known.after(rotation)
    affinity = (np.sqrt(known.fused) @ np.sqrt(belief)).astype(np.float64)
    weight, errors = 15.0 * affinity**power * share_of(known), errors_of(known)
    mean = errors.mean(axis=(0, 1))
    wanted = (np.tensordot(weight, errors) + 30.0 * mean) / (weight.sum() + 30.0)
    found = expected_errors(known, belief, power, 30.0)
    assert found.now_deg == pytest.approx(wanted[-1], rel=2e-3)
    assert found.after_deg == pytest.approx(wanted[:-1], rel=2e-3)


@pytest.mark.parametrize("most", [None, 20])
def test_what_was_given_may_be_changed_later(rng: np.random.Generator, most: int | None) -> None:
    distributions = random_sweeps(rng).astype(np.float32)
    belief = distributions[1, 4].copy()
    known = CalibrationViews.of_sweeps(distributions, most)
    before = expected_errors(known.after(7), belief, 5.0, 30.0)
    distributions[:] = 1.0 / distributions.shape[-1]
    after = expected_errors(known.after(7), belief, 5.0, 30.0)
    assert np.array_equal(after.after_deg, before.after_deg)


@pytest.mark.parametrize("rotations", [[], [5]])
@pytest.mark.parametrize("most", [None, 20])
def test_sums_are_of_whole_objects(
    rng: np.random.Generator, most: int | None, rotations: list[int]
) -> None:
    distributions, belief = random_sweeps(rng, 6), random_sweeps(rng)[0, 0]
    ids = ["b", "a", "b", "c", "a", "c"]
    known, of_sweeps = (
        CalibrationViews.of_sweeps(distributions, most, names) for names in (ids, None)
    )
    for rotation in rotations:
        known, of_sweeps = known.after(rotation), of_sweeps.after(rotation)
    share = rng.uniform(0.1, 1, 6)
    found = expected_errors(known, belief, 5.0, 30.0, share)
    wanted = [*found.after_deg, found.now_deg, 1.0]
    assert found.total / found.total[-1] == pytest.approx(wanted, rel=1e-5)
    assert len(found.by_object) == 3
    assert len(expected_errors(of_sweeps, belief, 5.0, 30.0).by_object) == 6
    for place, name in enumerate("abc"):
        own = np.where(np.array(ids) == name, share, 0.0)
        alone = expected_errors(known, belief, 5.0, 30.0, own)
        assert found.by_object[place] == pytest.approx(alone.by_object.sum(axis=0), rel=1e-3)


def test_agreement_is_the_log_bayes_factor_of_the_views(rng: np.random.Generator) -> None:
    distributions = random_sweeps(rng)
    for rotations in ([], [5], [5, 17]):
        known = CalibrationViews.of_sweeps(distributions, 40)
        for rotation in rotations:
            known = known.after(rotation)
        for sweep, views in enumerate(known.first):
            for place, first in enumerate(views):
                taken = [0, *rotations]
                own = distributions[sweep, [(first + k) % 24 for k in taken]]
                wanted = log_bayes_factor(own, [15.0 * k for k in taken])
                assert known.agreement[sweep, place] == pytest.approx(wanted, abs=1e-3)


def test_where_views_contradict_each_other_those_that_did_count(rng: np.random.Generator) -> None:
    distributions, belief = random_sweeps(rng, 6), random_sweeps(rng)[0, 0]
    known = CalibrationViews.of_sweeps(distributions).after(5)
    for agreement in (2.0, 0.0, -1.5):
        weight = 15.0 * (np.sqrt(known.fused) @ np.sqrt(belief)) ** 5.0 * share_of(known, agreement)
        errors = errors_of(known)
        sums = np.tensordot(weight, errors) + 30.0 * errors.mean(axis=(0, 1))
        found = expected_errors(known, belief, 5.0, 30.0, agreement=agreement)
        assert found.now_deg == pytest.approx(sums[-1] / (weight.sum() + 30.0), rel=1e-3)


@pytest.mark.parametrize("rotations", [[], [5]])
def test_probabilities_are_the_shares_of_errors_that_are_not_larger(
    rng: np.random.Generator, rotations: list[int]
) -> None:
    known, belief = (
        CalibrationViews.of_sweeps(sharp_sweeps(rng, 6, 3.0)),
        sharp_sweeps(rng, 1, 3.0)[0, 0],
    )
    for rotation in rotations:
        known = known.after(rotation)
    found = expected_errors(known, belief, 5.0, 30.0)
    weight = 15.0 * (np.sqrt(known.fused) @ np.sqrt(belief)) ** 5.0 * share_of(known)
    for limit, now, after in zip(WITHIN_DEG, found.within_now, found.within_after, strict=True):
        within = (errors_of(known) <= limit).astype(float)
        sums = np.tensordot(weight, within) + 30.0 * within.mean(axis=(0, 1))
        assert [*after, now] == pytest.approx(sums / (weight.sum() + 30.0), abs=1e-3)
    assert (np.diff(found.within_after, axis=0) >= 0).all()


def test_a_rotation_is_surely_better_by_two_standard_errors_over_objects() -> None:
    rng = np.random.default_rng(3)
    errors = rng.normal(5.0, 1.0, (40, 2))
    difference = errors[:, 0] - errors[:, 1]
    error = difference.std() / np.sqrt(40)
    for shift in (1.8, 2.2):
        moved = errors + np.array([-difference.mean() - shift * error, 0.0])
        expected = of_objects(moved, np.zeros(2), 40.0)
        assert expected.is_surely_better(0.0, 180.0) == (shift > 2)
        assert not expected.is_surely_better(180.0, 0.0)
    for shift in (0.8, 1.2):
        moved = errors[:, :1] - difference.mean() - shift * error
        expected = of_objects(moved, np.zeros(1), 40.0, errors[:, 1])
        assert expected.helps(0.0) == (shift > 1)


@pytest.mark.parametrize("by_share", [False, True])
def test_what_is_observed_was_expected_by_the_other_objects(
    rng: np.random.Generator, by_share: bool
) -> None:
    """Groups by what the others lead one to expect, and isotonic regression of their errors."""
    distributions = unclear_sweeps(rng, 16)
    ids = np.array([f"{k // 2}" for k in range(16)])
    # Groups of equal weight are then groups of equal size.
    share = np.full(16, 0.3) if by_share else None
    known = CalibrationViews.of_sweeps(distributions, None, ids.tolist())
    expected = []
    for sweep, own in enumerate(ids):
        others = np.where(ids != own, 1.0 if share is None else share, 0.0)
        expected += [
            expected_errors(known, view, 6.0, 3.0, others).now_deg for view in distributions[sweep]
        ]
    happened = known.error_now_deg.reshape(-1)
    outcomes = np.column_stack([happened, *(happened <= limit for limit in WITHIN_DEG)])
    groups = np.array_split(np.argsort(expected), N_GROUPS)
    places = [np.array(expected)[group].mean() for group in groups]
    means = np.array([outcomes[group].mean(axis=0) for group in groups])
    observed = np.array([observed_error(known, place, 6.0, 3.0, share) for place in places])
    for column, increasing in enumerate([True, False, False, False]):
        wanted = isotonic_regression(means[:, column], increasing=increasing).x
        assert observed[:, column] == pytest.approx(wanted, rel=1e-3, abs=1e-3)
    assert (np.diff(observed[:, 1:], axis=1) >= 0).all()


def test_views_that_do_not_count_are_not_observed() -> None:
    """As of frames at another elevation, where a share is next to nothing."""
    rng = np.random.default_rng(5)
    own, other = unclear_sweeps(rng, 12), np.full((12, 24, 24), 1 / 24)
    both = CalibrationViews.of_sweeps(np.concatenate([own, other]))
    alone = CalibrationViews.of_sweeps(own)
    share = np.repeat([1.0, 1e-12], 12)
    for place in (10.0, 30.0, 60.0):
        wanted = observed_error(alone, place, 6.0, 3.0)
        assert observed_error(both, place, 6.0, 3.0, share) == pytest.approx(
            wanted, rel=1e-3, abs=1e-3
        )
    assert observed_error(both, 60.0, 6.0, 3.0)[0] != pytest.approx(
        observed_error(alone, 60.0, 6.0, 3.0)[0]
    )


def test_small_and_large_errors_are_observed_as_they_are_on_fresh_objects() -> None:
    """In thirds of what is expected; a mean over look-alikes alone is drawn towards the middle."""
    rng = np.random.default_rng(4)
    known, fresh = (
        CalibrationViews.of_sweeps(unclear_sweeps(rng, 150)),
        unclear_sweeps(rng, 150),
    )
    errors = CalibrationViews.of_sweeps(fresh).error_now_deg.reshape(-1)
    expected = np.array(
        [expected_errors(known, v, 6.0, 3.0).now_deg for v in fresh.reshape(-1, 24)]
    )
    observed = np.array([observed_error(known, value, 6.0, 3.0)[0] for value in expected])
    for third in np.array_split(expected.argsort(), 3):
        assert observed[third].mean() == pytest.approx(errors[third].mean(), rel=0.15, abs=1.0)
    least, _, most = np.array_split(expected.argsort(), 3)
    assert expected[least].mean() > 5 * errors[least].mean()
    assert expected[most].mean() < 0.8 * errors[most].mean()

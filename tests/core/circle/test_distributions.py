"""Distributions: rotated, multiplied and summed up, against brute force and exact identities."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import softmax as softmax_of_scipy
from scipy.stats import circstd

from made_estimates import product_by_loops
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.distributions import (
    direction_and_spread_deg,
    in_object_frame,
    log_bayes_factor,
    mean_direction_deg,
    product_of_views,
    rotated,
)
from nbv.core.circle.estimates import posteriors_of
from nbv.core.circle.logits import LEAST_PROBABILITY, from_logits, on_degrees

BINS = 24
WIDTH = 360.0 / BINS

logits = arrays(np.float64, (3, BINS), elements=st.floats(-20, 20))
whole = st.integers(-60, 60)
any_rotation = st.floats(-800, 800)
uniform = np.full(BINS, 1 / BINS)


def beliefs(seed: int, n: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).dirichlet(np.full(BINS, 0.7), n) * (1 - 1e-9) + 1e-9 / BINS


# Distributions


@given(values=logits, temperature=st.floats(0.05, 20.0))
def test_distributions_are_the_softmax_with_a_floor(values, temperature):
    found = from_logits(values, temperature)
    assert found.dtype == np.float64
    assert found.sum(axis=1) == pytest.approx(1.0)
    assert found.min() >= LEAST_PROBABILITY / (1 + BINS * LEAST_PROBABILITY)
    assert found == pytest.approx(softmax_of_scipy(values / temperature, axis=1), abs=BINS * 1e-6)


@given(values=logits, temperature=st.floats(0.05, 20.0))
def test_distributions_are_those_that_the_experiments_use(values, temperature):
    wanted = posteriors_of(["a"], values[None], temperature).distributions[0]
    assert from_logits(values, temperature) == pytest.approx(wanted, rel=1e-9)


def test_large_logits_do_not_overflow():
    found = from_logits(np.array([[1e5, 0.0, -1e5]], dtype=np.float32), 0.05)
    assert found[0] == pytest.approx([1.0, LEAST_PROBABILITY, LEAST_PROBABILITY], rel=1e-5)


# Rotated


@given(values=logits, bins=whole)
def test_a_rotation_by_whole_bins_is_a_roll(values, bins):
    rows = softmax_of_scipy(values, axis=1)
    assert np.array_equal(rotated(rows, bins * WIDTH), np.roll(rows, -bins, axis=1))


@given(seed=st.integers(0, 10**6), rotation=any_rotation, bins=whole)
def test_rotations_add_up(seed, rotation, bins):
    rows = beliefs(seed)
    both = rotated(rows, rotation + bins * WIDTH)
    assert rotated(rotated(rows, rotation), bins * WIDTH) == pytest.approx(both, abs=1e-9)
    assert rotated(rotated(rows, bins * WIDTH), rotation) == pytest.approx(both, abs=1e-9)


@given(seed=st.integers(0, 10**6), rotation=any_rotation)
def test_it_is_the_density_between_the_bins(seed, rotation):
    """numpy's periodic interpolation of p at theta + rotation."""
    rows, centres = beliefs(seed), np.arange(BINS) * WIDTH
    for row, found in zip(rows, rotated(rows, rotation), strict=True):
        wanted = np.interp(centres + rotation, centres, row, period=360.0)
        assert found == pytest.approx(wanted, abs=1e-9)


@given(seed=st.integers(0, 10**6), degrees=st.integers(-400, 400))
def test_a_rotation_on_a_finer_grid_is_a_roll_too(seed, degrees):
    """The density between bins is that of `nbv.core.circle.logits.on_degrees`."""
    rows = beliefs(seed)
    fine = on_degrees(rotated(rows, float(degrees)))[:, :: int(WIDTH)]
    rolled = np.roll(on_degrees(rows), -degrees, axis=1)[:, :: int(WIDTH)]
    assert fine == pytest.approx(rolled, abs=1e-9)


def test_the_object_frame_rotates_each_view_by_its_azimuth():
    sweeps = np.random.default_rng(0).dirichlet(np.ones(BINS), (2, BINS))
    found = in_object_frame(sweeps)
    for i, view in np.ndindex(2, BINS):
        assert np.array_equal(found[i, view], rotated(sweeps[i, view], view * WIDTH))


# Fused


@given(seed=st.integers(0, 10**6), bins=st.lists(whole, min_size=2, max_size=2))
def test_a_fused_belief_is_the_product_of_all_views(seed, bins):
    rows = beliefs(seed)
    rotations = [0, *bins]
    wanted = product_by_loops(rows, rotations)
    wanted /= wanted.sum()
    found = product_of_views(rows, [rotation * WIDTH for rotation in rotations])
    assert found == pytest.approx(wanted, rel=1e-6, abs=1e-12)


@given(
    seed=st.integers(0, 10**6),
    order=st.permutations(range(4)),
    rotations=st.lists(any_rotation, min_size=4, max_size=4),
)
def test_the_order_of_views_does_not_matter(seed, order, rotations):
    rows = beliefs(seed, 4)
    found = product_of_views(rows[list(order)], [rotations[i] for i in order])
    assert found == pytest.approx(product_of_views(rows, rotations), rel=1e-6, abs=1e-12)


@given(seed=st.integers(0, 10**6), rotation=any_rotation)
def test_a_uniform_view_is_neutral(seed, rotation):
    row = beliefs(seed, 1)[0]
    assert product_of_views(np.stack([row, uniform]), [0.0, rotation]) == pytest.approx(row)
    assert product_of_views(np.stack([uniform, row]), [0.0, rotation]) == pytest.approx(
        rotated(row, rotation)
    )


def test_many_sure_views_do_not_underflow():
    row = from_logits(np.where(np.arange(BINS) == 7, 50.0, 0.0)[None], 1.0)
    found = product_of_views(np.repeat(row, 200, axis=0), [0.0] * 200)
    assert found[7] == pytest.approx(1.0)
    assert np.isfinite(found).all()
    # Views that exclude each other leave both possible.
    other = product_of_views(np.concatenate([row, row]), [0.0, 3 * WIDTH])
    assert other[7] == pytest.approx(other[4])


def test_views_and_rotations_are_as_many():
    with pytest.raises(ValueError):
        product_of_views(beliefs(0), [0.0, 15.0])


# Spread


def spread_deg(belief: np.ndarray) -> float:
    return direction_and_spread_deg(belief)[1]


@given(seed=st.integers(0, 10**6))
def test_the_direction_is_the_mean_direction(seed):
    row = beliefs(seed, 1)
    found, _ = direction_and_spread_deg(row[0])
    assert -180 <= found <= 180
    assert circular_distance_deg(found, mean_direction_deg(row)[0]) < 1e-9


@given(counts=arrays(np.int64, (BINS,), elements=st.integers(0, 20)))
def test_the_spread_is_the_circular_standard_deviation(counts):
    """That of scipy, of so many samples at the centre of each bin."""
    angles = np.radians(np.repeat(np.arange(BINS) * WIDTH, counts))
    if not len(angles):
        return
    length = abs(np.exp(1j * angles).mean())
    if length < 1e-6:
        return
    found = spread_deg(counts / counts.sum())
    assert found == pytest.approx(math.degrees(circstd(angles)), rel=1e-6, abs=1e-5)


def test_the_spread_of_one_bin_is_0_and_of_all_is_finite():
    assert spread_deg(np.eye(BINS)[5]) == pytest.approx(0.0, abs=1e-5)
    assert 360 < spread_deg(uniform) < math.inf
    opposite = (np.eye(BINS)[0] + np.eye(BINS)[12]) / 2
    assert math.isfinite(spread_deg(opposite))


# Whether views fit together


@given(st.integers(0, 99), st.lists(whole, min_size=2, max_size=2))
def test_the_bayes_factor_is_a_sum_over_poses(seed, bins):
    rows = beliefs(seed)
    rotations = [0, *bins]
    found = math.exp(log_bayes_factor(rows, [WIDTH * k for k in rotations]))
    assert found == pytest.approx(BINS**2 * product_by_loops(rows, rotations).sum(), rel=1e-9)


@pytest.mark.parametrize("least", [0.02, 0.1, 0.5])
def test_right_rotations_are_seldom_called_contradictory(least):
    """Markov's inequality, for distributions that are calibrated."""
    rng = np.random.default_rng(5)
    # The share of poses that give an answer, by answer: what a calibrated network says of it.
    given_pose = rng.dirichlet(np.full(BINS, 0.1), BINS).T
    posterior = given_pose / given_pose.sum(axis=1, keepdims=True)
    n, below, below_wrong = 4000, 0, 0
    for pose, place, wrong in rng.integers(BINS, size=(n, 3)):
        answers = [
            rng.choice(BINS, p=given_pose[:, at] / given_pose[:, at].sum())
            for at in (pose, (pose + place) % BINS)
        ]
        rows = posterior[answers] * (1 - 1e-9) + 1e-9 / BINS
        below += log_bayes_factor(rows, [0.0, WIDTH * place]) < math.log(least)
        below_wrong += log_bayes_factor(rows, [0.0, WIDTH * wrong]) < math.log(least)
    assert below / n <= least + 3 * math.sqrt(least / n)
    assert below_wrong > 2 * below

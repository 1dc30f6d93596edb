"""Decisions that azimuths and orientations share."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.core.choose import (
    entropy,
    expected_entropy,
    is_surely_less,
    least_cost,
    mixed,
    named,
    with_pseudo_observations,
)
from nbv.errors import UserError


@given(st.integers(0, 2**32 - 1))
def test_the_expected_entropy_is_that_of_every_posterior(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, likelihood = rng.dirichlet(np.ones(5)), rng.dirichlet(np.full(4, 0.3), 5)
    joint = belief[:, None] * likelihood
    predicted = joint.sum(axis=0)
    wanted = predicted @ entropy((joint / predicted).T)
    found = expected_entropy(entropy(belief), belief @ entropy(likelihood), predicted)
    assert found == pytest.approx(wanted, abs=1e-9)


def test_products_are_mixed_and_uniform_where_they_are_impossible() -> None:
    rng = np.random.default_rng(0)
    belief, first = rng.dirichlet(np.ones(3), 2), rng.dirichlet(np.ones(4), 3)
    second = rng.dirichlet(np.ones(4), (5, 3))
    first[1], second[2, 1] = [1, 0, 0, 0], [0, 1, 0, 0]
    found = mixed(belief, first, second)
    for move in range(5):
        rows = first * second[move]
        if move == 2:
            rows[1] = 1.0
        wanted = belief @ (rows / rows.sum(axis=1, keepdims=True))
        assert found[move] == pytest.approx(wanted)


@pytest.mark.parametrize("alpha", [0, 1, 7])
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_pseudo_observations_are_further_observations_of_the_mean(
    rng: np.random.Generator, alpha: int, share: float
) -> None:
    values, weights, mean = rng.normal(size=(20, 3)), share * rng.random(20), np.arange(3.0)
    total = with_pseudo_observations(weights @ values, mean, alpha)
    weight = with_pseudo_observations(weights.sum(), 1.0, alpha)
    # Without any observation there is one of the mean.
    n_further = alpha or int(share == 0.0)
    everything = np.vstack([values, np.tile(mean, (n_further, 1))])
    wanted = np.average(everything, axis=0, weights=[*weights, *np.ones(n_further)])
    assert total / weight == pytest.approx(wanted)


def test_among_equal_costs_the_least_travel_and_then_the_first_wins() -> None:
    cost = np.array([[2.0, 1.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0]])
    travel = np.array([0.0, 30.0, 10.0, 10.0])
    assert least_cost(cost, travel).tolist() == [2, 0]
    assert least_cost(cost[None], travel).tolist() == [[2, 0]]


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_a_mean_is_surely_less_beyond_its_standard_errors(factor: float) -> None:
    rng = np.random.default_rng(1)
    gaps = rng.normal(0.0, 1.0, 20)
    error = gaps.std(ddof=1) / np.sqrt(20)
    for shift in (0.99, 1.01):
        moved = gaps - gaps.mean() - shift * factor * error
        assert is_surely_less(moved, factor) == (shift > 1)
        assert is_surely_less(3.0 * moved, factor, np.full(20, 3.0)) == (shift > 1)
        assert not is_surely_less(moved, factor, prior=20.0)


@pytest.mark.parametrize("n", [2, 9])
def test_with_weights_the_mean_is_a_ratio_of_sums(n: int) -> None:
    rng = np.random.default_rng(n)
    weights = rng.uniform(0.1, 5.0, n)
    gaps = weights * rng.normal(size=n)
    rest = gaps - gaps.sum() / weights.sum() * weights
    limit = -gaps.sum() - 2.0 * np.sqrt(n / (n - 1) * (rest @ rest))
    assert is_surely_less(gaps, 2.0, weights, limit - 1e-9)
    assert not is_surely_less(gaps, 2.0, weights, limit + 1e-9)
    assert not is_surely_less(np.zeros(n), 1.0)


def test_an_unknown_name_gets_the_nearest() -> None:
    assert named("criterion", "one", {"one": 1}) == 1
    with pytest.raises(UserError, match="criterion 'oen' is unknown: did you mean 'one'"):
        named("criterion", "oen", {"one": 1})

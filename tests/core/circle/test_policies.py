"""Choosing a second view, taking it and fusing both."""

import numpy as np
import pytest

from made_estimates import estimates, evidence_of
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.fusion import ESTIMATE_FUSIONS, FUSIONS, rotation_errors_deg
from nbv.core.circle.lookup import build_lookup
from nbv.core.circle.policies import HeldOutViews, needs_lookup, take_second_views, two_views
from nbv.errors import UserError


def test_two_view_error_is_that_of_a_plain_loop():
    rng = np.random.default_rng(1)
    estimate = rng.uniform(0, 360, (3, 36))
    delta = rng.integers(0, 36, (3, 36)) * 10
    made = take_second_views(delta, "average", HeldOutViews(estimate))
    for o in range(3):
        for v in range(36):
            second = estimate[o, (v + delta[o, v] // 10) % 36]
            assert made.second_deg[o, v] == second
            total = np.exp(1j * np.radians(estimate[o, v]))
            total += np.exp(1j * np.radians(second - delta[o, v]))
            error = np.degrees(np.angle(total * np.exp(-1j * np.radians(10 * v))))
            assert made.error_deg[o, v] == pytest.approx(abs(error), abs=1e-6)


@pytest.mark.parametrize("fusion", ESTIMATE_FUSIONS)
def test_the_oracle_is_the_least_of_all_rotations(fusion):
    views = HeldOutViews(estimates(2, seed=6), evidence_of())
    every = rotation_errors_deg(views.estimate_deg, views.evidence, fusion)
    reached = two_views("oracle", fusion, views).error_deg
    np.testing.assert_allclose(reached, every.min(axis=0), atol=1e-4)
    for index in (0, 5, 23):
        delta = np.full(views.estimate_deg.shape, index * 15)
        error = take_second_views(delta, fusion, views).error_deg
        np.testing.assert_allclose(every[index], error, atol=1e-3)


def test_policies_by_name():
    views = HeldOutViews(estimates(2, seed=6), evidence_of(), np.random.default_rng(0))
    assert (two_views("opposite", "average", views).delta_deg == 180).all()
    alone = two_views("none", "average", views)
    assert alone.delta_deg is None
    np.testing.assert_array_equal(alone.pose_deg, views.estimate_deg)
    table = build_lookup(views.evidence, "information_gain")
    followed = two_views("information_gain", "average", views).delta_deg
    np.testing.assert_array_equal(followed, table.least_cost(views.estimate_deg))
    given = two_views("information_gain", "average", HeldOutViews(views.estimate_deg, lookup=table))
    np.testing.assert_array_equal(given.delta_deg, followed)


def test_a_criterion_goes_by_the_distribution_of_each_image_where_there_is_one():
    rng, evidence = np.random.default_rng(0), evidence_of()
    unseen = estimates(2, seed=6)
    distributions = rng.dirichlet(np.full(24, 0.3), unseen.shape)
    views = HeldOutViews(unseen, evidence, distributions=distributions)
    made = two_views("information_gain", "product", views)
    belief = Belief(distributions.reshape(-1, 24).astype(np.float32), evidence)
    cost = CRITERIA["information_gain"](belief, evidence, "product").reshape(2, 48, 24)
    assert (
        cost.min(axis=2)
        == np.take_along_axis(cost, made.delta_deg[..., None] // 15, axis=2)[..., 0]
    ).all()
    for o, v in ((0, 3), (1, 40)):
        delta = made.delta_deg[o, v]
        second = distributions[o, (v + delta * 48 // 360) % 48]
        pose = FUSIONS["product"](distributions[o, v][None], second[None], np.array([delta]))
        assert circular_distance_deg(made.pose_deg[o, v], pose[0]) < 1e-9


@pytest.mark.parametrize(
    ("policy", "fusion", "missing"),
    [
        ("random", "average", "needs a generator"),
        ("pose_ambiguity", "average", "needs a lookup table or evidence"),
        ("opposite", "product", "needs distributions"),
    ],
)
def test_what_is_missing_is_named(policy, fusion, missing):
    with pytest.raises(ValueError, match=missing):
        two_views(policy, fusion, HeldOutViews(estimates()))


def test_what_needs_a_lookup_table():
    assert needs_lookup("pose_ambiguity")
    assert not needs_lookup("none")
    assert not needs_lookup("opposite")
    assert not needs_lookup("oracle")
    with pytest.raises(UserError, match="did you mean 'opposite'"):
        needs_lookup("oposite")

"""What a choice of plan can gain at most."""

from __future__ import annotations

import numpy as np
import pytest
from nbv.experiment.plan_bound import (
    BEST_OF_OTHERS,
    BEST_OF_OWN,
    EVENLY_SPACED,
    picked_by_others,
    plan_bounds,
)
from studies.kept_estimates import held_out
from tests.experiment.test_two_views import N_CLASSES, hidden_handle, mean_directions

from nbv.core.angles import circular_distance_deg
from nbv.core.distributions import mean_direction_deg

N_OBJECTS = 3


def held_of(trainings=3):
    """Of each training the same objects, one fold each, with estimators of their own."""
    found = {}
    for training in range(trainings):
        made = hidden_handle(N_OBJECTS, 0)
        noise = np.random.default_rng(training).normal(0, 0.7, made.log_posterior.shape)
        noisy = type(made)(made.object_ids, made.log_posterior + noise, made.temperature)
        found[training, 0, "mug", 0, 1, "test"] = held_out(mean_directions(noisy), noisy)
    return found


def brute_force_two_views(held):
    """Errors (n_trainings, n_rotations, n_objects, n_views) of the product of two views."""
    azimuth_deg = np.arange(N_CLASSES) * 360 / N_CLASSES
    errors = np.empty((len(held), N_CLASSES, N_OBJECTS, N_CLASSES))
    for r, one in enumerate(held.values()):
        p = one.posteriors.distributions
        for rotation, o, view in np.ndindex(errors.shape[1:]):
            second = np.roll(p[o, (view + rotation) % N_CLASSES], -rotation)
            pose_deg = mean_direction_deg((p[o, view] * second)[None])[0]
            errors[r, rotation, o, view] = circular_distance_deg(pose_deg, azimuth_deg[view])
    return errors


def means(bounds, choice, n_views):
    part = bounds[(bounds["choice"] == choice) & (bounds["n_views"] == n_views)]
    wide = part.set_index(["shuffle", "replicate", "object_id"])["error_deg"]
    return wide.sort_index().to_numpy().reshape(-1, N_OBJECTS)


def test_two_views_are_picked_among_all_rotations_as_by_brute_force():
    held = held_of()
    bounds = plan_bounds(held, 2, 0.0)
    errors = brute_force_two_views(held)
    # The first view is no second one.
    errors = np.delete(errors, 0, axis=1)
    expected = np.empty((3, N_OBJECTS, N_CLASSES))
    for r, o, view in np.ndindex(expected.shape):
        of_others = sum(errors[q, :, o, view] for q in range(3) if q != r)
        expected[r, o, view] = errors[r, of_others.argmin(), o, view]
    np.testing.assert_allclose(means(bounds, BEST_OF_OTHERS, 2), expected.mean(axis=-1), atol=0.5)
    own = errors.min(axis=1).mean(axis=-1)
    np.testing.assert_allclose(means(bounds, BEST_OF_OWN, 2), own, atol=0.01)
    opposite = errors[:, N_CLASSES // 2 - 1].mean(axis=-1)
    np.testing.assert_allclose(means(bounds, EVENLY_SPACED, 2), opposite, atol=0.01)


def test_nothing_is_better_than_what_a_training_picks_for_itself():
    bounds = plan_bounds(held_of(), 4, 15.0)
    for n_views in (2, 3, 4):
        own = means(bounds, BEST_OF_OWN, n_views)
        for choice in (EVENLY_SPACED, BEST_OF_OTHERS):
            assert (own <= means(bounds, choice, n_views) + 1e-6).all()


def test_trainings_that_agree_pick_for_each_other_what_they_pick_for_themselves():
    rng = np.random.default_rng(0)
    one = rng.random((5, 4, 7)).astype(np.float32)
    np.testing.assert_array_equal(picked_by_others(np.stack([one] * 3))[0], one.min(axis=0))


def test_chance_gains_nothing_when_others_pick():
    """Errors that are chance alone: the least of one training is low, what others pick is not."""
    errors = np.random.default_rng(0).random((3, 40, 200, 50))
    assert errors.min(axis=1).mean() < 0.03
    assert abs(picked_by_others(errors).mean() - 0.5) < 0.01


def test_one_training_has_no_others():
    with pytest.raises(ValueError, match="two trainings"):
        plan_bounds(held_of(1), 2, 0.0)

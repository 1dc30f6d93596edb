"""Held-out estimates in a compact file."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.kept_estimates import (
    held_out,
    join_kept,
    keep_estimates,
    kept_settings,
    read_held_out,
    read_kept,
)

from made_estimates import objects
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.errors import UserError
from nbv.experiment.estimates import write_estimates, write_posteriors

N_CLASSES = 24
KEY = (1, 2, "coffee_mug", 15, 3, "test")


def posteriors_of(estimates, seed=0):
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(N_CLASSES, 0.2), estimates.estimate_deg.shape)
    return Posteriors(estimates.object_ids, np.log(np.maximum(p, 1e-9)), 0.7)


@given(st.integers(0, 99))
def test_estimates_are_kept_to_half_a_hundredth_of_a_degree(seed):
    rng = np.random.default_rng(seed)
    estimates = Estimates(("a", "b"), rng.uniform(0, 360, (2, 36)))
    again = held_out(estimates).estimates
    assert circular_distance_deg(again.estimate_deg, estimates.estimate_deg).max() <= 0.005001
    assert again.estimate_deg.min() >= 0
    assert again.estimate_deg.max() < 360
    twice = held_out(again)
    np.testing.assert_array_equal(twice.residual, held_out(estimates).residual)


def test_180_and_360_degrees_are_angles_like_others():
    truth = np.arange(4) * 90.0
    estimates = Estimates(("a",), (np.add(truth, [180.0, -180.0, 359.999, 0.004]) % 360)[None])
    kept = held_out(estimates)
    assert kept.residual.tolist() == [[-18000, -18000, 0, 0]]
    np.testing.assert_array_equal(kept.estimates.estimate_deg, [[180.0, 270.0, 180.0, 270.0]])


def test_distributions_of_views_a_class_apart_are_kept_in_their_own_frames():
    estimates = objects(2, 0)
    before = posteriors_of(estimates)
    kept = held_out(estimates, before)
    step = 360 // N_CLASSES
    p, again = before.distributions[:, ::step], kept.posteriors.distributions
    assert again.shape == (2, N_CLASSES, N_CLASSES)
    # A twentieth of a nat by rounding, and what the sum is away from 1: in the tails as well.
    assert np.abs(np.log(again) - np.log(p)).max() < 0.1
    np.testing.assert_allclose(again.sum(axis=-1), 1.0)
    # In the frame of the truth, class 0 is the right answer of every view.
    right = np.rint(-10 * np.log(p[:, np.arange(N_CLASSES), np.arange(N_CLASSES)]))
    np.testing.assert_array_equal(kept.surprisal[:, :, 0], right)
    np.testing.assert_array_equal(
        kept.estimates_of_posteriors.estimate_deg, kept.estimates.estimate_deg[:, ::step]
    )
    assert held_out(estimates).posteriors is None


def test_a_file_and_the_estimates_give_the_same(tmp_path):
    estimates = objects(3, 1)
    posteriors = posteriors_of(estimates)
    write_estimates(tmp_path / "test.csv", estimates)
    write_posteriors(tmp_path / "test.npz", posteriors)
    read = read_held_out(tmp_path / "test.csv", tmp_path / "test.npz")
    other = (0, 0, "chair", 0, 1, "calibration")
    kept = {KEY: read, other: held_out(estimates)}
    keep_estimates(tmp_path / "kept.npz", kept, {"name": "tiny"})
    settings, keys = kept_settings(tmp_path / "kept.npz")
    assert settings == {"name": "tiny"}
    assert keys == [KEY, other]
    again = read_kept(tmp_path / "kept.npz")
    for key, one in kept.items():
        assert again[key].object_ids == one.object_ids
        np.testing.assert_array_equal(again[key].residual, one.residual)
        np.testing.assert_array_equal(again[key].estimates.estimate_deg, one.estimates.estimate_deg)
    np.testing.assert_array_equal(
        again[KEY].posteriors.log_posterior, read.posteriors.log_posterior
    )
    assert again[other].surprisal is None


def test_another_file_is_named(tmp_path):
    np.savez(tmp_path / "other.npz", a=np.zeros(2))
    for read in (kept_settings, read_kept):
        with pytest.raises(UserError, match=r"other\.npz.*not a file of kept estimates"):
            read(tmp_path / "other.npz")
        with pytest.raises(UserError, match=r"none\.npz"):
            read(tmp_path / "none.npz")


def test_files_of_the_same_settings_are_joined(tmp_path):
    one, two = held_out(objects(2, 0)), held_out(objects(2, 1))
    other = (0, 1, *KEY[2:])
    keep_estimates(tmp_path / "a.npz", {KEY: one}, {"seed": 1})
    keep_estimates(tmp_path / "b.npz", {other: two}, {"seed": 1})
    join_kept(tmp_path / "all.npz", [tmp_path / "a.npz", tmp_path / "b.npz"])
    settings, keys = kept_settings(tmp_path / "all.npz")
    assert (settings, keys) == ({"seed": 1}, [KEY, other])
    found = read_kept(tmp_path / "all.npz", [other])
    assert list(found) == [other]
    np.testing.assert_array_equal(found[other].residual, two.residual)
    with pytest.raises(UserError, match=r"a\.npz: holds no estimates of 0/1/coffee_mug"):
        read_kept(tmp_path / "a.npz", [other])
    keep_estimates(tmp_path / "b.npz", {other: two}, {"seed": 2})
    with pytest.raises(UserError, match=r"b\.npz: kept with other settings"):
        join_kept(tmp_path / "all.npz", [tmp_path / "a.npz", tmp_path / "b.npz"])

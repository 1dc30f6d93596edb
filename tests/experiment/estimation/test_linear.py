"""Linear estimators against brute force, exact identities and what they must not see."""

import numpy as np
import pandas as pd
import pytest

from nbv.core.circle.angles import circular_distance_deg, mirrored_bins
from nbv.core.circle.logits import softmax
from nbv.experiment.estimation.linear import (
    N_PARTS,
    PENALTIES,
    fit_classes,
    fit_directions,
    fit_fold,
)
from nbv.experiment.estimation.outputs import decode_classes, decode_directions

N_OBJECTS, N_VIEWS, HALF = 7, 24, 6
AZIMUTHS_DEG = np.arange(N_VIEWS) * (360.0 / N_VIEWS)
PHI = np.radians(AZIMUTHS_DEG)
CLASSES = {"kind": "linear_classifier", "n_classes": 12, "target_bandwidth_deg": 20}


@pytest.fixture
def features(rng) -> np.ndarray:
    """Parts of features that know something about the azimuth, (n, n_views, 2 HALF)."""
    known = np.stack([np.cos(PHI), np.sin(PHI), np.cos(2 * PHI)], axis=1)
    noise = rng.normal(size=(N_OBJECTS, N_VIEWS, 2 * HALF))
    known = known @ rng.normal(size=(3, 2 * HALF)) + 0.5 * rng.normal(size=(N_OBJECTS, 1, 2 * HALF))
    return (known + noise + 1.0).astype(np.float32)


def ridge(x, y, penalty) -> tuple[np.ndarray, np.ndarray]:
    """Minimise the sum of squares with a bias, by least squares on rows for the penalty."""
    x, mean = x - x.mean(axis=0), x.mean(axis=0)
    strength = np.sqrt(penalty * np.trace(x.T @ x) / x.shape[1])
    rows = np.concatenate([x, strength * np.eye(x.shape[1])])
    wanted = np.concatenate([y, np.zeros((x.shape[1], y.shape[1]))])
    weights, *_ = np.linalg.lstsq(rows, wanted, rcond=None)
    return weights, -mean @ weights


def test_directions_are_the_ridge_regression_whose_penalty_errs_least_on_left_out_objects(features):
    wanted = np.stack([np.cos(PHI), np.sin(PHI)], axis=1)
    x = features.astype(np.float64)

    def rows(objects):
        return x[objects].reshape(-1, 2 * HALF), np.tile(wanted, (len(objects), 1))

    def left_out_error(penalty):
        error = 0.0
        for part in range(N_PARTS):
            out = np.arange(N_OBJECTS) % N_PARTS == part
            weights, bias = ridge(*rows(np.flatnonzero(~out)), penalty)
            unseen, target = rows(np.flatnonzero(out))
            error += np.square(unseen @ weights + bias - target).sum()
        return error

    best = min(PENALTIES, key=left_out_error)
    weights, bias = ridge(*rows(np.arange(N_OBJECTS)), best)
    fitted = fit_directions(features, None)
    assert fitted.penalty == best
    np.testing.assert_allclose(fitted.weights, weights, atol=1e-5)
    np.testing.assert_allclose(fitted.bias, bias, atol=1e-5)
    np.testing.assert_allclose(fitted.outputs(features), x @ weights + bias, atol=1e-5)


@pytest.mark.parametrize("plane_deg", [0.0, 37.5, 90.0])
def test_a_mirror_image_has_the_mirrored_estimate(features, plane_deg):
    fitted = fit_directions(features, plane_deg)
    mirrored = features * np.repeat(np.float32([1, -1]), HALF)
    estimate, other = (decode_directions(fitted.outputs(each)) for each in (features, mirrored))
    assert circular_distance_deg(other, 2 * plane_deg - estimate).max() < 1e-3


def test_a_plane_elsewhere_rotates_the_estimates_by_its_azimuth(features):
    """Who calls the handle's azimuth 90 instead of 0 gets each estimate 90 degrees on."""
    step = N_VIEWS // 4
    rotated = np.roll(features, step, axis=1)
    before = decode_directions(fit_directions(features, 0.0).outputs(features))
    after = decode_directions(fit_directions(rotated, 90.0).outputs(features))
    assert circular_distance_deg(after, before + 90.0).max() < 1e-3


def test_even_and_odd_parts_are_fitted_as_images_and_mirror_images_would_be(features):
    """Over images and mirror images the parts are uncorrelated: two regressions are one."""
    fitted = fit_directions(features, 0.0)
    even, odd = (
        features[..., part].astype(np.float64) for part in (slice(HALF), slice(HALF, None))
    )
    even = even - even.mean(axis=(0, 1))
    x = np.concatenate([np.concatenate([even, sign * odd], axis=2) for sign in (1, -1)])
    y = np.concatenate([np.stack([np.cos(PHI), s * np.sin(PHI)], axis=1) for s in (1, -1)])
    wanted = np.concatenate([np.tile(part, (N_OBJECTS, 1)) for part in np.split(y, 2)])
    rows = x.reshape(-1, 2 * HALF)
    residual = wanted - rows @ fitted.weights
    slope = rows.T @ residual
    # At a ridge's optimum the slope of the squares is the penalty times the weights.
    for part, column in ((slice(HALF), 0), (slice(HALF, None), 1)):
        weights = fitted.weights[part, column]
        ratio = slope[part, column] / weights
        np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(fitted.weights[:HALF, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(fitted.weights[HALF:, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("plane_deg", [None, 0.0, 90.0])
def test_classes_know_more_than_a_uniform_distribution_and_decode_near_the_truth(
    features, plane_deg
):
    if plane_deg is not None:
        # Parts that a camera could see: even in the azimuth from the plane, and odd.
        phi = PHI - np.radians(plane_deg)
        shown = np.stack([np.cos(phi), np.cos(2 * phi), np.sin(phi), np.sin(2 * phi)], axis=1)
        features = 0.1 * features[..., :4] + shown.astype(np.float32)
    fitted = fit_classes(features, CLASSES, plane_deg)
    logits = fitted.outputs(features)
    at_truth = softmax(logits)[:, ::2][:, np.arange(12), np.arange(12)]
    assert np.log(at_truth).mean() > np.log(1 / 12) + 0.3
    if plane_deg is None:
        return
    assert np.median(circular_distance_deg(decode_classes(logits), AZIMUTHS_DEG)) < 15
    mirrored = fitted.outputs(features * np.repeat(np.float32([1, -1]), 2))
    apart = softmax(mirrored)[..., mirrored_bins(12, plane_deg)] - softmax(logits)
    assert np.abs(apart).max() < 0.05


NAMES = ("a", "b", "c", "d", "e", "f", "g")


def splits(*roles: str) -> pd.DataFrame:
    return pd.DataFrame({"object_id": NAMES, "fold": 1, "role": roles})


def test_a_fold_learns_from_its_training_objects_alone(features):
    roles = splits("test", "train", "calibration", "train", "train", "train", "calibration")
    stored = features.astype(np.float16)
    fitted, outputs = fit_fold(stored, NAMES, roles, 1, {"kind": "linear"}, 0.0)
    assert [names for names, _ in outputs.values()] == [["c", "g"], ["a"]]
    seen = fit_directions(stored[[1, 3, 4, 5]].astype(np.float32), 0.0)
    np.testing.assert_array_equal(fitted.weights, seen.weights)
    np.testing.assert_array_equal(outputs["test"][1][0], fitted.outputs(stored[0].astype("f4")))


def test_each_part_is_estimated_by_a_fit_to_the_others(features):
    roles = splits("test", "part1", "part1", "part1", "part2", "part2", "part2")
    stored = features.astype(np.float16)
    _, outputs = fit_fold(stored, NAMES, roles, 1, {"kind": "linear"}, None)
    names, found = outputs["calibration"]
    assert names == list("bcdefg")
    first = fit_directions(stored[4:].astype(np.float32), None)
    second = fit_directions(stored[1:4].astype(np.float32), None)
    expected = [first.outputs(stored[1:4].astype("f4")), second.outputs(stored[4:].astype("f4"))]
    np.testing.assert_array_equal(found, np.concatenate(expected))

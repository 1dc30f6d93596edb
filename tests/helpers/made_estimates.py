"""Estimates and evidence made for tests."""

import math

import numpy as np

from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates
from nbv.core.circle.evidence import gather_evidence

N_BINS = 24
SETTINGS = {"pose_likelihood": "given_estimate", "spread": "entropy"}
FEW_DENSITIES = SETTINGS | {"bandwidths_deg": [6, 12], "pseudo_observations": [10], "n_parts": 2}
EXTENSIONS = {
    "random_posterior": {"policy": "random", "fusion": "posterior"},
    "opposite_posterior": {"policy": "opposite", "fusion": "posterior"},
    "gain_posterior": {"policy": "information_gain", "fusion": "posterior"},
    "error_average": {"policy": "expected_error", "fusion": "average"},
    "selected": {"policy": "selected", "fusion": "selected"},
    "opposite_selected": {"policy": "opposite", "fusion": "selected"},
    "oracle_posterior": {"policy": "oracle", "fusion": "posterior"},
}


def estimates(n_objects=3, n_views=48, seed=0, worst_deg=90.0):
    """Estimates (n_objects, n_views) that are sharp but round one azimuth."""
    rng = np.random.default_rng(seed)
    truth = np.arange(n_views) * (360.0 / n_views)
    spread = 8 + 60 * np.exp(-((circular_distance_deg(truth, worst_deg) / 40) ** 2))
    return (truth + rng.normal(0, spread, (n_objects, n_views))) % 360


def objects(n_objects, seed, hidden_deg=90.0):
    """The same of whole sweeps in single degrees, with names."""
    found = np.round(estimates(n_objects, 360, seed, hidden_deg), 4) % 360
    return Estimates(tuple(f"{seed}-{k}" for k in range(n_objects)), found)


def evidence_of(estimate_deg=None, bandwidth_deg=12.0, pseudo_observations=2.0, n_bins=N_BINS):
    return gather_evidence(
        estimates() if estimate_deg is None else estimate_deg,
        SETTINGS,
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        n_bins=n_bins,
    )


def product_by_loops(rows, rotations):
    """The unnormalised product of views: prod_i p_i(theta + rotation_i), rotations in bins."""
    n_bins = len(rows[0])
    return np.array(
        [
            math.prod(p[(theta + k) % n_bins] for p, k in zip(rows, rotations, strict=True))
            for theta in range(n_bins)
        ]
    )


def direction_by_loops(row):
    """The direction of a distribution's first moment, degrees."""
    moment = sum(p * np.exp(2j * np.pi * theta / len(row)) for theta, p in enumerate(row))
    return float(np.degrees(np.angle(moment)))


def hidden_range_estimates(n_objects: int, seed: int = 0) -> np.ndarray:
    """Estimates of objects whose azimuth cannot be told within 45 degrees of 90."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    hidden = np.abs(truth - 90) < 45
    estimate = truth + rng.normal(0, 4, (n_objects, 360))
    estimate[:, hidden] = 90 + rng.normal(0, 10, (n_objects, hidden.sum()))
    return estimate % 360


def sharp_sweeps(rng: np.random.Generator, n: int, sharpness: float) -> np.ndarray:
    apart = np.arange(24) - np.arange(24)[:, None]
    logits = sharpness * np.cos(np.radians(15 * apart)) + rng.normal(0, 0.3, (n, 24, 24))
    return np.exp(logits) / np.exp(logits).sum(axis=-1, keepdims=True)


def unclear_sweeps(rng: np.random.Generator, n: int) -> np.ndarray:
    """Sweeps that are clear from half of the views; from the others, an answer may be opposite."""
    distributions = sharp_sweeps(rng, n, 12.0)
    is_wrong = rng.random((n, 24)) < 0.4 * (np.arange(24) < 12)
    flat = np.where(np.arange(24) < 12, 0.4, 1.0)[:, None]
    rows = np.where(is_wrong[..., None], np.roll(distributions, 12, axis=-1), distributions) ** flat
    return rows / rows.sum(axis=-1, keepdims=True)

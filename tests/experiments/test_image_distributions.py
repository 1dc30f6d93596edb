from __future__ import annotations

import numpy as np

from nbv.angles import circular_distance_deg
from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.experiments.image_distributions import evaluate_beliefs
from nbv.experiments.two_views import COLUMNS

N_CLASSES = 36


def hidden_handle(n_objects: int, seed: int) -> Posteriors:
    """Distributions that know the azimuth, except within 50 degrees of 90, where all look alike."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    centres = np.arange(N_CLASSES) * 360 / N_CLASSES
    answer = truth + rng.normal(0, 3, (n_objects, 360))
    seen = np.exp((np.cos(np.radians(centres - answer[..., None])) - 1) / np.radians(8) ** 2)
    hidden = circular_distance_deg(truth, 90) < 50
    blind = np.where(circular_distance_deg(centres, 90) < 50, 1.0, 1e-6)
    p = np.where(hidden[:, None], blind, seen) + 1e-9
    names = tuple(f"{seed}-{i}" for i in range(n_objects))
    return Posteriors(names, np.log(p / p.sum(axis=-1, keepdims=True)), 1.0)


def test_a_hidden_handle_is_looked_for_and_found():
    test, calibration = hidden_handle(3, 0), hidden_handle(5, 1)
    centres = np.radians(np.arange(N_CLASSES) * 360 / N_CLASSES)
    mean = np.exp(test.log_posterior) @ np.exp(1j * centres)
    estimates = Estimates(test.object_ids, np.degrees(np.angle(mean)) % 360, abs(mean))
    frames = evaluate_beliefs(estimates, test, calibration)
    hidden = circular_distance_deg(frames["belief"]["initial_deg"], 90) < 50
    for frame in frames.values():
        assert tuple(frame.columns) == COLUMNS
        views = (frame["initial_deg"] + frame["delta_deg"]) % 360
        expected = estimates.estimate_deg.reshape(3, 360)
        rows = np.repeat(np.arange(3), 360)
        np.testing.assert_allclose(frame["next_estimate_deg"], expected[rows, views])
    assert (frames["belief_opposite"]["delta_deg"] == 180).all()
    assert circular_distance_deg(estimates.estimate_deg, np.arange(360)).ravel()[hidden].mean() > 20
    assert frames["belief"]["error_deg"][hidden].mean() < 5

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import log_softmax

from nbv.core.circle.distributions import estimate_likelihood
from nbv.core.circle.logits import TEMPERATURES, fit_temperature, log_likelihood, on_degrees


def random_logits(seed: int, shape=(6, 24)) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 2, shape)


@given(st.integers(0, 99), st.sampled_from([8, 24, 72, 120, 360]))
def test_densities_over_degrees_keep_their_mass_and_turn_with_the_classes(seed, k):
    p = np.exp(log_softmax(random_logits(seed, (3, k)), axis=-1))
    spread = on_degrees(p)
    np.testing.assert_allclose(spread.sum(axis=1), 1.0)
    rotated = on_degrees(np.roll(p, 1, axis=1))
    np.testing.assert_allclose(rotated, np.roll(spread, 360 // k, axis=1))
    np.testing.assert_allclose(spread[:, :: 360 // k] * (360 / k), p)


@given(st.integers(0, 99), st.sampled_from([8, 72]))
def test_the_log_likelihood_reads_the_density_at_the_azimuth(seed, k):
    logs = log_softmax(random_logits(seed, (360, k)), axis=-1)
    spread = on_degrees(np.exp(logs))
    found = log_likelihood(logs, np.arange(360))
    np.testing.assert_allclose(found, np.log(np.diag(spread)))


@settings(max_examples=20)
@given(st.integers(0, 19), st.sampled_from([0.3, 1.0, 3.0]))
def test_the_temperature_is_the_best_of_a_grid(seed, scale):
    rng = np.random.default_rng(seed)
    azimuth = rng.integers(0, 360, 200)
    # Logits of a network that is right to within 20 degrees, and sure by another scale.
    centre = np.radians(azimuth + rng.normal(0, 20, 200))[:, None]
    logits = scale * 10 * np.cos(2 * np.pi * np.arange(24) / 24 - centre)

    def loss(temperature):
        logs = log_softmax(logits / temperature, axis=-1)
        return -log_likelihood(logs, azimuth).mean()

    found = fit_temperature(logits, azimuth)
    grid = np.geomspace(*TEMPERATURES, 200)
    assert loss(found) <= min(map(loss, grid)) + 1e-6


def test_answers_are_the_mean_distribution_of_each_viewpoint():
    logs = log_softmax(random_logits(4, (3, 48, 24)), axis=-1)
    found = estimate_likelihood(np.exp(logs))
    # 7.5 degrees a view and 15 a class: centred on the even views, half-way ones go upwards.
    for viewpoint in range(24):
        views = [2 * viewpoint - 1, 2 * viewpoint]
        np.testing.assert_allclose(found[viewpoint], np.exp(logs[:, views]).mean(axis=(0, 1)))

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import i0e, i1e

from nbv.core.circle import density

B = 24


def random_pairs(seed: int, n: int = 300):
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 360, n).astype(float)
    return (truth + rng.normal(0, 25, n)) % 360, truth


def brute_force_smooth(counts, kernel):
    n = len(counts)
    out = np.zeros_like(counts)
    for e in range(n):
        for g in range(n):
            for a in range(n):
                for b in range(n):
                    out[e, g] += counts[a, b] * kernel[(e - a) % n] * kernel[(g - b) % n]
    return out


@pytest.mark.parametrize("n_bins", [9, 12])
def test_smoothing_is_the_double_sum_over_the_torus(n_bins):
    counts = density.pair_counts(*random_pairs(0, 40), n_bins)
    expected = brute_force_smooth(counts, density.von_mises_kernel(n_bins, 25.0))
    np.testing.assert_allclose(density.smooth(counts, 25.0), expected, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 99), st.integers(0, B - 1), st.sampled_from([0.0, 10.0, 40.0]))
def test_turning_the_object_rolls_both_conditionals(seed, k, bandwidth):
    estimate, truth = random_pairs(seed)
    kwargs = {"bandwidth_deg": bandwidth, "pseudo_observations": 5.0, "n_bins": B}
    before = density.conditionals(estimate, truth, **kwargs)
    shift = k * 360 / B
    after = density.conditionals((estimate + shift) % 360, (truth + shift) % 360, **kwargs)
    for one, two in ((before.viewpoint, after.viewpoint), (before.estimate, after.estimate)):
        np.testing.assert_allclose(np.roll(one, (k, k), (0, 1)), two, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 99), st.floats(0.5, 60), st.floats(0, 100))
def test_rows_are_distributions(seed, bandwidth, alpha):
    pair = density.conditionals(
        *random_pairs(seed, 20), bandwidth_deg=bandwidth, pseudo_observations=alpha, n_bins=B
    )
    for rows in (pair.viewpoint, pair.estimate):
        assert (rows >= 0).all()
        np.testing.assert_allclose(rows.sum(axis=1), 1.0)


def test_kernel_is_von_mises_by_its_entropy():
    """Against the closed form of the entropy, log(2 pi I0(k)) - k I1(k)/I0(k)."""
    sigma = 20.0
    kappa = 1 / np.radians(sigma) ** 2
    kernel = density.von_mises_kernel(720, sigma)
    cell = 2 * np.pi / 720
    differential = -np.sum(kernel * np.log(kernel / cell))
    log_i0 = np.log(i0e(kappa)) + kappa
    closed = np.log(2 * np.pi) + log_i0 - kappa * i1e(kappa) / i0e(kappa)
    assert differential == pytest.approx(closed, abs=1e-9)


def test_kernel_is_continuous_across_zero_and_even():
    kernel = density.von_mises_kernel(360, 6.0)
    np.testing.assert_allclose(kernel[1:], kernel[1:][::-1])
    assert kernel[0] > kernel[1] > kernel[2]
    # One degree of a bandwidth of one degree: exp(-1/2), as of a Gaussian.
    narrow = density.von_mises_kernel(360, 1.0)
    assert narrow[1] / narrow[0] == pytest.approx(np.exp(-0.5), rel=1e-3)


def test_no_smoothing_and_no_pseudo_observations_are_the_plain_frequencies():
    estimate, truth = [10.0, 10.0, 10.0, 200.0], [10.0, 20.0, 20.0, 200.0]
    pair = density.conditionals(estimate, truth, bandwidth_deg=0, pseudo_observations=0, n_bins=36)
    assert pair.viewpoint[1, 1] == pytest.approx(1 / 3)
    assert pair.viewpoint[1, 2] == pytest.approx(2 / 3)
    assert pair.estimate[2, 1] == 1.0
    np.testing.assert_allclose(pair.viewpoint[5], 1 / 36)  # never seen: uniform


def test_pseudo_observations_weigh_the_same_at_any_number_of_bins():
    estimate, truth = random_pairs(3, 4000)
    fine, coarse = (
        density.conditionals(
            estimate, truth, bandwidth_deg=20, pseudo_observations=30, n_bins=n
        ).viewpoint
        for n in (360, 120)
    )
    # Bins are centred: three fine bins straddle the coarse one when rolled by one.
    merged = np.roll(fine[::3], 1, axis=1).reshape(120, 120, 3).sum(axis=2)
    np.testing.assert_allclose(merged, coarse, atol=2e-3)


@pytest.mark.parametrize("kwargs", [{"bandwidth_deg": -1.0}, {"pseudo_observations": -1.0}])
def test_negative_settings_are_refused(kwargs):
    full = {"bandwidth_deg": 5.0, "pseudo_observations": 1.0} | kwargs
    with pytest.raises(ValueError, match="0 or more"):
        density.conditionals([1.0], [2.0], **full)


def test_a_row_of_little_mass_keeps_its_shape():
    joint = np.array([[0.1, 0.3], [0.0, 0.0]])
    np.testing.assert_allclose(density.conditional(joint, 0.0), [[0.25, 0.75], [0.5, 0.5]])


def test_a_row_without_an_observation_is_uniform_after_smoothing_too():
    """Transforms leave rounding in rows that no kernel reaches."""
    azimuths = np.arange(100.0, 120.0)
    pair = density.conditionals(azimuths, azimuths, bandwidth_deg=4, pseudo_observations=0)
    assert np.all(pair.viewpoint[290] == 1 / 360)
    assert np.all(pair.estimate[290] == 1 / 360)
    assert pair.viewpoint[110].argmax() == 110


def test_pseudo_observations_are_counted_in_rows_of_360_bins():
    """One pair, not smoothed: ten observations of 360 rows are a hundred of 36."""
    pair = density.conditionals([10.0], [20.0], bandwidth_deg=0, pseudo_observations=10, n_bins=36)
    assert pair.viewpoint[1, 2] == pytest.approx((1 + 100 / 36) / 101, rel=1e-12)
    assert pair.viewpoint[1, 3] == pytest.approx(100 / 36 / 101, rel=1e-12)


def test_bins_are_of_one_degree_unless_said_otherwise():
    pair = density.conditionals([1.0], [2.0], bandwidth_deg=5, pseudo_observations=1)
    assert pair.n_bins == 360


def test_a_bandwidth_of_0_leaves_everything_in_its_bin():
    np.testing.assert_array_equal(density.von_mises_kernel(5, 0.0), [1, 0, 0, 0, 0])

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nbv.experiment.statistics import metrics
from nbv.experiment.statistics.metrics import above_90, accuracy_area, statistic_of

errors_strategy = arrays(np.float64, st.integers(1, 40), elements=st.floats(0, 180))


@given(errors_strategy)
def test_pea_counts_errors_strictly_below_the_threshold(errors):
    thresholds = np.array([0.0, 1.0, 45.0, 100.0, 180.0, *errors[:3]])
    expected = [sum(e < t for e in errors) / len(errors) for t in thresholds]
    np.testing.assert_allclose(metrics.pea(errors, thresholds), expected, rtol=0, atol=1e-15)


@given(errors_strategy)
@settings(max_examples=40)
def test_pauc_is_the_integral_of_pea(errors):
    # PEA is a step function: between neighbouring steps the midpoint's value times the width is
    # exact, so this integral has no discretisation error.
    edges = np.unique(np.concatenate([[0.0, 100.0], errors[errors < 100.0]]))
    middle = metrics.pea(errors, (edges[:-1] + edges[1:]) / 2)
    integral = float(np.sum(middle * np.diff(edges)))
    assert statistic_of(errors, "pauc") == pytest.approx(integral, abs=1e-9)


def test_pauc_by_whole_degrees_lies_half_a_degree_lower():
    # The note on the published pAUC: a left sum over whole degrees loses about 0.5.
    errors = np.random.default_rng(0).gamma(2.0, 5.0, 200_000)
    published_way = float(np.mean(metrics.pea(errors, np.arange(100)))) * 100
    assert statistic_of(errors, "pauc") - published_way == pytest.approx(0.5, abs=0.02)


@given(errors_strategy)
def test_pauc_never_counts_more_than_the_mean(errors):
    assert statistic_of(errors, "pauc") >= 100.0 - statistic_of(errors, "mae") - 1e-9
    assert 0.0 <= statistic_of(errors, "pauc") <= 100.0


def test_fold_std_is_the_sample_one():
    values = [1.0, 2.0, 4.0]
    mean = sum(values) / 3
    assert metrics.fold_std(values) == pytest.approx(
        (sum((v - mean) ** 2 for v in values) / 2) ** 0.5
    )
    assert metrics.fold_std([1.0, 3.0]) == pytest.approx(2**0.5)


@pytest.mark.parametrize("values", [[], [3.0]])
def test_fewer_than_two_folds_have_no_deviation_and_give_no_warning(values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(metrics.fold_std(values))


def test_an_image_adds_what_its_error_leaves_of_100_degrees():
    found = accuracy_area([0.0, 30.0, 100.0, 170.0])
    np.testing.assert_array_equal(found, [100.0, 70.0, 0.0, 0.0])


def test_the_resamples_of_figures_without_an_image_are_no_numbers():
    values, objects = [2.0, 4.0], np.array([0, 0])
    drawn = np.array([[1, 0], [0, 1], [2, 0]])  # the second object has no image
    for resampled in (metrics.resampled_means, metrics.resampled_medians):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = resampled(values, objects, drawn)
        assert np.isnan(found).tolist() == [False, True, False]


@pytest.mark.parametrize("resampled", [metrics.resampled_means, metrics.resampled_medians])
def test_a_resample_of_one_image_has_its_figure(resampled):
    found = resampled([2.0, 7.0], np.array([0, 1]), np.eye(2, dtype=np.int64))
    np.testing.assert_array_equal(found, [2.0, 7.0])


def test_resampled_medians_of_few_images_are_the_lower_medians(rng):
    """Up to a thousand images the grid holds each value."""
    objects, values, _ = _uneven_objects(rng)
    multiplicities = metrics.resample_objects(7, np.random.default_rng(5), 50)
    found = metrics.resampled_medians(values, objects, multiplicities)
    repeated = (np.repeat(values, counts[objects]) for counts in multiplicities)
    expected = [np.quantile(each, 0.5, method="inverted_cdf") for each in repeated]
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, expected)


def test_the_interval_leaves_out_samples_that_are_no_numbers():
    samples = [np.nan, *np.arange(101.0), np.inf]
    assert metrics.percentile_interval(samples) == pytest.approx((2.5, 97.5))
    assert metrics.percentile_interval(samples, 0.5) == pytest.approx((25.0, 75.0))
    assert np.isnan(metrics.percentile_interval([np.nan])).all()


def test_a_resample_draws_as_many_objects_as_there_are():
    drawn = metrics.resample_objects(4, np.random.default_rng(2), 6)
    again = np.random.default_rng(2).integers(4, size=(6, 4))
    expected = [[int((row == one).sum()) for one in range(4)] for row in again]
    assert drawn.tolist() == expected
    assert drawn.dtype == np.int64
    # An object that is never drawn last still has its column.
    assert metrics.resample_objects(50, np.random.default_rng(2), 1).shape == (1, 50)


@pytest.mark.parametrize("name", ["mae", "median", "pauc"])
def test_no_errors_is_an_error(name):
    with pytest.raises(ValueError, match=r"^no errors to summarise$"):
        statistic_of([], name)


def test_errors_in_single_precision_are_summed_in_double(rng):
    narrow = rng.gamma(2.0, 8.0, 999).astype(np.float32)
    errors = narrow.astype(np.float64)
    assert statistic_of(narrow, "mae") == statistic_of(errors, "mae") == errors.mean()
    assert statistic_of(narrow, "pauc") == statistic_of(errors, "pauc")
    left = accuracy_area(narrow)
    np.testing.assert_array_equal(left, 100.0 - errors.clip(max=100.0))
    assert metrics.fold_std(narrow) == metrics.fold_std(errors)
    assert metrics.percentile_interval(narrow) == metrics.percentile_interval(errors)
    assert metrics.pea(narrow, [3]).dtype == np.float64


def test_an_interval_gives_its_columns():
    found = metrics.Interval(1.0, 0.5, 2.0)
    assert found.columns("difference") == {
        "difference": 1.0,
        "difference_low": 0.5,
        "difference_high": 2.0,
    }
    assert found.columns("value", "ci") == {"value": 1.0, "ci_low": 0.5, "ci_high": 2.0}


def _uneven_objects(rng, n_objects=7):
    objects = np.repeat(np.arange(n_objects), rng.integers(1, 9, n_objects))
    return objects, rng.gamma(2.0, 5.0, objects.size), rng.gamma(2.0, 6.0, objects.size)


def test_resampling_equals_a_naive_loop_over_the_same_draws(rng):
    objects, a, b = _uneven_objects(rng)
    drawn = np.random.default_rng(5).integers(7, size=(50, 7))
    multiplicities = metrics.resample_objects(7, np.random.default_rng(5), 50)
    naive = []
    for draw in drawn:
        rows = np.concatenate([np.flatnonzero(objects == one) for one in draw])
        naive.append(np.mean(a[rows]) - np.mean(b[rows]))
    fast = metrics.resampled_means(a, objects, multiplicities) - metrics.resampled_means(
        b, objects, multiplicities
    )
    np.testing.assert_allclose(fast, naive, atol=1e-12)
    assert metrics.percentile_interval(fast) == pytest.approx(
        tuple(np.quantile(naive, [0.025, 0.975]))
    )


def test_resampled_medians_equal_a_naive_loop_to_within_the_grid(rng):
    objects = np.repeat(np.arange(20), 300)
    values = rng.gamma(2.0, 5.0, objects.size) + objects
    multiplicities = metrics.resample_objects(20, np.random.default_rng(5), 30)
    naive = []
    for counts in multiplicities:
        rows = np.repeat(np.arange(objects.size), counts[objects])
        naive.append(np.median(values[rows]))
    fast = metrics.resampled_medians(values, objects, multiplicities)
    rank = np.searchsorted(np.sort(values), fast) - np.searchsorted(np.sort(values), naive)
    assert np.abs(rank).max() <= objects.size / 1000 + 2


def test_an_error_of_exactly_90_degrees_is_not_above_90():
    assert above_90([0.0, 90.0, 90.1, 180.0]).tolist() == [0.0, 0.0, 100.0, 100.0]
    assert statistic_of([0.0, 90.0, 90.1, 180.0], "above_90_percent") == 50.0

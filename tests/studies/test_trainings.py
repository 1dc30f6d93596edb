"""Intervals over objects and trainings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from studies.trainings import crossed_mean, holm, predicted_by_others


def simulated(rng, n_trainings, n_objects, of_training=0.1, remainder=1.0):
    """Differences of mean 0, skewed over objects as errors are, with an effect of each training."""

    def skewed(shape):
        return (rng.gamma(0.5, 1.0, shape) - 0.5) / np.sqrt(0.5)

    return (
        skewed((1, n_objects))
        + of_training * rng.standard_normal((n_trainings, 1))
        + remainder * skewed((n_trainings, n_objects))
    )


@pytest.mark.parametrize("n_objects", [15, 125])
@pytest.mark.parametrize("of_training", [0.0, 0.1, 0.3])
def test_intervals_cover_the_truth_about_as_often_as_they_say(n_objects, of_training):
    """95 %, on skewed errors; intervals over the objects of one training do not."""
    rng, n = np.random.default_rng(0), 1500
    both = alone = 0
    for _ in range(n):
        table = simulated(rng, 5, n_objects, of_training)
        found = crossed_mean(table).interval()
        both += found.low <= 0 <= found.high
        one = crossed_mean(table[:1]).interval()
        alone += one.low <= 0 <= one.high
    assert 0.91 <= both / n <= 0.98
    if of_training == 0.3:
        assert alone / n < 0.9


def test_the_variance_is_that_of_the_mean_over_new_objects_and_trainings():
    """Without bias: the mean of what is estimated is the variance of the estimates."""
    rng = np.random.default_rng(1)
    found = [crossed_mean(simulated(rng, 4, 30, 0.3)) for _ in range(4000)]
    variance = np.var([mean.value for mean in found])
    assert np.mean([mean.variance for mean in found]) == pytest.approx(variance, rel=0.1)
    assert pytest.approx(variance, rel=0.1) == 1 / 30 + 0.3**2 / 4 + 1 / 120


@given(st.integers(2, 30), st.integers(0, 999))
def test_one_training_gives_students_interval_over_objects(n_objects, seed):
    values = np.random.default_rng(seed).normal(1.0, 2.0, n_objects)
    found = crossed_mean(values[None]).interval()
    low, high = stats.t.interval(0.95, n_objects - 1, loc=values.mean(), scale=stats.sem(values))
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))
    expected = stats.ttest_1samp(values, 0.0).pvalue
    assert crossed_mean(values[None]).p_value == pytest.approx(expected)


@given(st.integers(2, 6), st.integers(2, 20), st.floats(0.1, 9.0), st.integers(0, 99))
def test_scale_order_and_sign_change_nothing_else(n_trainings, n_objects, factor, seed):
    rng = np.random.default_rng(seed)
    table = rng.normal(1, 1, (n_trainings, n_objects))
    mean = crossed_mean(table)
    shuffled = rng.permutation(rng.permutation(table, axis=0), axis=1)
    for other, scale in ((shuffled, 1.0), (factor * table, factor), (-table, -1.0)):
        found = crossed_mean(other)
        assert found.value == pytest.approx(scale * mean.value)
        assert found.variance == pytest.approx(scale**2 * mean.variance)
        assert found.degrees_of_freedom == pytest.approx(mean.degrees_of_freedom)


@given(st.integers(2, 6), st.integers(2, 8), st.integers(0, 999))
def test_no_interval_is_wider_than_the_scarcer_factor_alone_makes_it(n_trainings, n_objects, seed):
    found = crossed_mean(np.random.default_rng(seed).normal(0, 1, (n_trainings, n_objects)))
    fewest = min(n_trainings, n_objects) - 1
    assert found.degrees_of_freedom >= fewest
    half = stats.t.ppf(0.975, fewest) * np.sqrt(found.variance)
    assert found.interval().high - found.value <= half * (1 + 1e-9)


def test_the_same_errors_in_every_training_leave_the_objects_alone():
    of_objects = np.random.default_rng(0).normal(0, 1, 20)
    found, alone = crossed_mean(np.tile(of_objects, (5, 1))), crossed_mean(of_objects[None])
    assert found.variance == pytest.approx(alone.variance)
    assert found.degrees_of_freedom == pytest.approx(alone.degrees_of_freedom)


def test_nothing_that_varies_is_sure():
    assert crossed_mean(np.zeros((3, 4))).p_value == 1.0
    same = crossed_mean(np.full((3, 4), 2.0))
    assert same.p_value == 0.0
    assert (same.interval().low, same.interval().high) == (2.0, 2.0)


def test_one_object_says_nothing_about_others():
    assert np.isnan(crossed_mean([[1.0], [2.0]]).variance)


@pytest.mark.parametrize("values", [[], [1.0, 2.0], [[np.nan, 1.0]], [[]]])
def test_what_is_no_table_of_finite_values_is_refused(values):
    with pytest.raises(ValueError, match="needs a finite value"):
        crossed_mean(values)


@pytest.mark.parametrize("n_trainings", [3, 5])
@pytest.mark.parametrize("sizes", [(8,), (6, 15)])
def test_the_other_trainings_predict_a_training_as_often_as_they_say(n_trainings, sizes):
    rng, inside, n = np.random.default_rng(3), 0, 1500
    for _ in range(n):
        objects = [rng.gamma(0.5, 1.0, size) for size in sizes]
        tables = [each + rng.normal(0.0, 0.3, (n_trainings, each.size)) for each in objects]
        found = predicted_by_others(tables)[0]
        assert found.value == pytest.approx(np.concatenate(tables, axis=1)[0].mean())
        inside += found.low <= found.value <= found.high
    assert 0.94 <= inside / n <= 0.96


def test_the_prediction_is_the_classical_one_and_needs_two_others():
    table = np.random.default_rng(1).normal(size=(4, 7))
    means = table.mean(axis=1)
    for own, found in enumerate(predicted_by_others([table])):
        others = np.delete(means, own)
        ends = stats.t(2, others.mean(), others.std(ddof=1) * np.sqrt(4 / 3)).interval(0.95)
        assert (found.low, found.high) == pytest.approx(ends)
    assert predicted_by_others([table[:2]]) == []


def test_categories_are_pooled_by_their_objects():
    rng = np.random.default_rng(0)
    tables = [rng.normal(1, 1, (3, n)) for n in (10, 30)]
    found = crossed_mean(*tables)
    assert found.value == pytest.approx(np.concatenate([t.mean(axis=0) for t in tables]).mean())
    assert (found.n_objects, found.n_trainings) == (40, 3)
    # Categories are not drawn: how far they are apart is no chance.
    apart = crossed_mean(tables[0] + 50.0, tables[1])
    assert apart.variance == pytest.approx(found.variance)
    assert crossed_mean(tables[0]) == crossed_mean(*tables[:1])
    with pytest.raises(ValueError, match="same trainings"):
        crossed_mean(tables[0], tables[1][:2])


@pytest.mark.parametrize("equal_categories", [False, True])
@pytest.mark.parametrize("shared", [0.0, 0.3])
def test_categories_may_share_what_varies_between_trainings(shared, equal_categories):
    """One pretrained network for all of them: their means vary together."""
    rng, n, inside, values, variances = np.random.default_rng(5), 1500, 0, [], []
    for _ in range(n):
        of_training = shared * rng.standard_normal((5, 1))
        tables = [simulated(rng, 5, size, 0.1) + of_training for size in (20, 40)]
        found = crossed_mean(*tables, equal_categories=equal_categories)
        inside += found.interval().low <= 0 <= found.interval().high
        values.append(found.value)
        variances.append(found.variance)
    assert np.mean(variances) == pytest.approx(np.var(values), rel=0.15)
    assert 0.91 <= inside / n <= 0.98


@pytest.mark.parametrize("n_shuffles", [3, 5])
def test_intervals_cover_where_folds_share_their_calibration_objects(n_shuffles):
    """Each shuffle has its own folds, and each fold its own network and calibration objects."""
    rng, n, n_objects, inside = np.random.default_rng(7), 1000, 60, 0
    for _ in range(n):
        objects = rng.gamma(0.5, 1.0, n_objects) - 0.5
        table = np.empty((n_shuffles, n_objects))
        for row in table:
            fold = rng.permutation(n_objects) % 5
            row[:] = objects + rng.normal(0.0, 0.5, 5)[fold] + rng.normal(0.0, 0.5, n_objects)
        found = crossed_mean(table).interval()
        inside += found.low <= 0 <= found.high
    assert 0.91 <= inside / n <= 0.98


def test_what_has_no_p_value_does_not_count_for_others():
    found = holm({"a": 0.03, "b": float("nan"), "c": 0.01})
    assert (found["a"], found["c"]) == (0.03, 0.02)
    assert np.isnan(found["b"])


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_rejects_what_the_step_down_rule_rejects(values):
    p_values = {str(place): value for place, value in enumerate(values)}
    adjusted = holm(p_values)
    assert list(adjusted) == list(p_values)
    for level in (0.01, 0.05, 0.5):
        rejected, ordered = set(), sorted(p_values, key=lambda name: p_values[name])
        for place, name in enumerate(ordered):
            if p_values[name] * (len(ordered) - place) > level:
                break
            rejected.add(name)
        assert {name for name in adjusted if adjusted[name] <= level} == rejected

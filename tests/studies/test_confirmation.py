"""Means and contrasts over all trainings."""

import itertools

import numpy as np
import pandas as pd
import pytest
from studies import confirmation
from studies.confirmation import (
    ALL,
    BELIEF_COLUMNS,
    BELIEFS_COLUMNS,
    CONTRASTS_COLUMNS,
    EQUALLY,
    METHODS_COLUMNS,
    OBJECTS_COLUMNS,
    TRAININGS_COLUMNS,
    Contrast,
    belief_means,
    contrasts_of,
    method_contrasts,
    method_means,
    training_contrasts,
)
from studies.trainings import crossed_mean, holm, predicted_by_others

from nbv.errors import UserError

SHIFT = {
    ("none", "none", 1): 4.0,
    ("random", "average", 2): 3.0,
    ("fixed", "average", 2): 2.0,
    ("opposite", "average", 2): 2.5,
    ("given_estimate", "average", 2): 1.5,
    ("given_truth_likeliest", "average", 2): 3.5,
    ("through_estimate", "average", 2): 1.2,
    ("expected_error", "average", 2): 1.0,
    ("fixed", "product", 2): 0.5,
    ("expected_error", "product", 2): 0.0,
    ("evenly_spaced", "product", 3): -0.5,
    ("information_gain", "product", 3): -1.0,
}
TRAININGS = [(0, 0), (0, 1), (1, 0)]
SIZES = {"mug": 8, "car": 5}


def objects_frame(noise=0.3):
    rng = np.random.default_rng(0)
    rows = []
    for (category, n), training in itertools.product(SIZES.items(), TRAININGS):
        for method, shift in SHIFT.items():
            for k in range(n):
                error = 10 + k + shift + rng.normal(0, noise)
                figures = (error, 100 - error, 5.0, 90.0)
                fold = 1 + (k + training[0]) % 2
                rows.append(
                    ("real", category, *training, fold, *method, f"{category}{k}", *figures)
                )
    return pd.DataFrame(rows, columns=list(OBJECTS_COLUMNS))


@pytest.fixture(scope="module")
def objects():
    return objects_frame()


def table_of(objects, category, method):
    """Errors (n_trainings, n_objects), by loops."""
    part = objects[objects["category"] == category]
    names = sorted(set(part["object_id"]))
    table = np.empty((len(TRAININGS), len(names)))
    for row in part.itertuples():
        if (row.choice, row.fusion, row.n_views) == method:
            table[TRAININGS.index((row.shuffle, row.replicate)), names.index(row.object_id)] = (
                row.error_deg
            )
    return table


def test_means_are_over_objects_and_trainings(objects):
    found = method_means(objects)
    assert tuple(found.columns) == METHODS_COLUMNS
    assert len(found) == 3 * len(SHIFT)
    indexed = found.set_index(["category", "choice", "fusion", "n_views"])
    for method in SHIFT:
        tables = [table_of(objects, category, method) for category in SIZES]
        parts = [crossed_mean(table) for table in tables]
        for category, mean in zip((*SIZES, ALL), (*parts, crossed_mean(*tables)), strict=True):
            row = indexed.loc[(category, *method)]
            ends = mean.interval()
            assert row["mae_deg"] == pytest.approx(mean.value)
            assert (row["low"], row["high"]) == pytest.approx((ends.low, ends.high))
            assert row["n_objects"] == mean.n_objects
            assert row["n_trainings"] == 3
            assert row["pauc"] == pytest.approx(100 - mean.value)
    assert set(found["above_90_percent"]) == {5.0}


def test_beliefs_have_the_same_means(objects):
    figures = ["error_deg", "pauc_percent", "above_90_percent"]
    renamed = objects.rename(columns=dict(zip(figures, BELIEF_COLUMNS, strict=True)))
    found, expected = belief_means(renamed), method_means(objects)
    assert tuple(found.columns) == BELIEFS_COLUMNS
    ours = ["log_likelihood", "low", "high", "inside_50_percent", "inside_90_percent"]
    theirs = ["mae_deg", "low", "high", "pauc", "above_90_percent"]
    np.testing.assert_array_equal(found[ours], expected[theirs])


def test_contrasts_are_paired_by_object_and_training(objects):
    found = method_contrasts(objects)
    assert tuple(found.columns) == CONTRASTS_COLUMNS
    indexed = found.set_index(["category", "contrast", "fusion"])
    row = indexed.loc[("mug", "expected_error - fixed", "average")]
    mine, other = (
        table_of(objects, "mug", (choice, "average", 2)) for choice in ("expected_error", "fixed")
    )
    mean = crossed_mean(mine - other)
    assert row["difference_deg"] == pytest.approx(mean.value)
    assert row["difference_deg"] == pytest.approx(-1.0, abs=0.3)
    # Objects differ by degrees, the difference does not: it is paired.
    assert row["high"] - row["low"] < 1.0


def test_all_but_primary_contrasts_over_all_categories_are_adjusted_together(objects):
    found = method_contrasts(objects)
    for category in ("car", ALL):
        raw, primary = {}, set()
        for contrast in contrasts_of(list(SHIFT)):
            tables = [
                table_of(objects, one, contrast.method) - table_of(objects, one, contrast.other)
                for one in (SIZES if category == ALL else [category])
            ]
            key = contrast.name, contrast.method[1]
            raw[key] = crossed_mean(*tables).p_value
            if contrast.question and category == ALL:
                primary.add(key)
        family = {"|".join(key): p for key, p in raw.items() if key not in primary}
        # The plan for 3 views of question 5.
        adjusted = holm(family | ({} if category == ALL else {"plan": 1.0}))
        rows = found[found["category"] == category].set_index(["contrast", "fusion"])
        for key, p_value in raw.items():
            expected = p_value if key in primary else adjusted["|".join(key)]
            assert rows.loc[key, "p_holm"] == pytest.approx(expected)


def test_plans_keep_their_p_values_in_the_kept_data_sets(objects, monkeypatch):
    before = method_contrasts(objects).set_index(["category", "contrast", "fusion"])["p_holm"]
    plans = {("real", "mug", 3): 0.0}
    monkeypatch.setattr(confirmation, "PLANS_P_VALUES", plans)
    after = method_contrasts(objects).set_index(["category", "contrast", "fusion"])["p_holm"]
    changed = before.index[before != after].get_level_values("category")
    assert set(changed) == {"mug"}
    mug = before["mug"]
    assert after["mug", mug.idxmin()[0], mug.idxmin()[1]] < mug.min()


def test_categories_of_different_sizes_are_also_pooled_with_equal_weight(objects):
    found = method_contrasts(objects).set_index(["category", "contrast", "fusion"])
    name = "expected_error - fixed", "average"
    parts = [found.loc[(one, *name), "difference_deg"] for one in SIZES]
    assert found.loc[(EQUALLY, *name), "difference_deg"] == pytest.approx(np.mean(parts))
    weighted = np.average(parts, weights=list(SIZES.values()))
    assert found.loc[(ALL, *name), "difference_deg"] == pytest.approx(weighted)
    same = objects[~objects["object_id"].isin(["mug5", "mug6", "mug7"])]
    assert EQUALLY not in set(method_contrasts(same)["category"])


def test_each_training_is_compared_with_the_others(objects):
    found = training_contrasts(objects)
    assert tuple(found.columns) == TRAININGS_COLUMNS
    assert len(found) == 3 * len(contrasts_of(list(SHIFT))) * len(TRAININGS)
    keys = ["category", "contrast", "fusion", "shuffle", "replicate"]
    indexed = found.set_index(keys)
    for category in (*SIZES, ALL):
        tables = [
            table_of(objects, one, ("expected_error", "average", 2))
            - table_of(objects, one, ("fixed", "average", 2))
            for one in (SIZES if category == ALL else [category])
        ]
        for training, expected in zip(TRAININGS, predicted_by_others(tables), strict=True):
            row = indexed.loc[(category, "expected_error - fixed", "average", *training)]
            shown = row["difference_deg"], row["low"], row["high"]
            assert shown == pytest.approx((expected.value, expected.low, expected.high))


def test_categories_are_together_only_under_the_same_trainings(objects):
    some = objects[(objects["category"] == "mug") | (objects["shuffle"] == 0)]
    assert set(method_means(some)["category"]) == {"mug", "car"}


def test_fewer_than_three_trainings_and_unlike_ones_are_not_compared(objects):
    two = objects[objects["shuffle"] == 0]
    assert training_contrasts(two).empty
    some = objects[(objects["category"] == "mug") | (objects["shuffle"] == 0)]
    assert set(training_contrasts(some)["category"]) == {"mug"}


def test_names_say_what_differs():
    names = {one.name for one in contrasts_of(list(SHIFT))}
    assert names == {
        "expected_error - fixed",
        "expected_error - opposite",
        "expected_error - random",
        "given_estimate - opposite",
        "given_estimate - fixed",
        "given_estimate - none (none)",
        "given_truth_likeliest - given_estimate",
        "through_estimate - given_estimate",
        "through_estimate - opposite",
        "expected_error - given_estimate (average)",
        "information_gain - evenly_spaced, 3 views",
    }
    assert Contrast(("a", "x", 2), ("b", "x", 2)).name == "a - b"


def test_a_regressor_answers_for_the_paper_and_a_classifier_for_the_product():
    regressor = [method for method in SHIFT if method[1] != "product"]
    answers = {
        name: {
            (one.question, one.name, one.method[1]) for one in contrasts_of(methods) if one.question
        }
        for name, methods in (("classifier", list(SHIFT)), ("regressor", regressor))
    }
    assert answers["classifier"] == {
        (1, "expected_error - fixed", "product"),
        (4, "expected_error - given_estimate (average)", "product"),
    }
    assert answers["regressor"] == {
        (1, "expected_error - fixed", "average"),
        (2, "given_estimate - opposite", "average"),
        (3, "given_truth_likeliest - given_estimate", "average"),
        (6, "through_estimate - given_estimate", "average"),
        (6, "through_estimate - opposite", "average"),
    }


def test_a_training_without_an_object_or_with_it_twice_is_named(objects):
    with pytest.raises(UserError, match="real, mug: a training lacks an object"):
        method_means(objects.drop(index=objects.index[0]))
    twice = pd.concat([objects, objects.iloc[[0]]])
    with pytest.raises(UserError, match="real, mug: an object is tested twice"):
        method_contrasts(twice)


def test_one_category_has_no_line_for_all(objects):
    found = method_means(objects[objects["category"] == "mug"])
    assert set(found["category"]) == {"mug"}

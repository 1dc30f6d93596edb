"""Mean errors by object, and which methods differ."""

import numpy as np
import pandas as pd
import pytest
from studies.object_errors import (
    OBJECT_COLUMNS,
    indistinct_from_best,
    load_folds,
    mae_difference,
    mae_interval,
    object_means,
    paired_objects,
)

from nbv.errors import UserError
from nbv.experiment.statistics import metrics
from nbv.experiment.statistics.paired import PairedErrors, Resampler
from nbv.files import write_csv


@pytest.fixture(scope="module")
def frames(evaluations):
    mug = evaluations["mug", 0]
    return {str(name): part for name, part in mug.groupby("method", observed=True)}


@pytest.fixture(scope="module")
def sample():
    """Thirty objects; `close` differs from `best` by chance, `worse` by two degrees."""
    rng = np.random.default_rng(0)
    shared = rng.normal(10, 3, 30)
    rows = [
        (method, f"{k:02d}", 1 + k % 5, shared[k] + shift + rng.normal(0, 0.5))
        for method, shift in (("best", 0.0), ("close", 0.05), ("worse", 2.0))
        for k in range(30)
    ]
    columns = ["method", "object_id", "fold", "error_deg"]
    return paired_objects(pd.DataFrame(rows, columns=columns), "mug")


def test_object_means_are_plain_means(frames):
    means = object_means(frames)
    assert tuple(means.columns) == OBJECT_COLUMNS
    indexed = means.set_index(["method", "object_id"])
    for method in ("single", "proposed"):
        of_method = frames[method]
        mine = of_method[of_method["object_id"] == "0004"]
        found = indexed.loc[(method, "0004")]
        assert found["error_deg"] == pytest.approx(np.mean(mine["error_deg"]))
        assert found["pauc_percent"] == pytest.approx(
            metrics.statistic_of(mine["error_deg"], "pauc")
        )
        share = np.mean(mine["error_deg"] > 90)
        assert found["above_90_percent"] == pytest.approx(100 * share)
        delta = [0.0 if np.isnan(d) else float(d) for d in mine["delta_deg"]]
        shorter = [min(d % 360, -d % 360) for d in delta]
        assert found["travel_deg"] == pytest.approx(np.mean(shorter))
        assert found["n_images"] == len(mine) == 360


def test_places_are_told_and_not_read_from_paths(frames, tmp_path):
    means = object_means(frames)
    write_csv(tmp_path / "a.csv", means, 12)
    write_csv(tmp_path / "b.csv", means.iloc[::-1], 12)
    files = {("mug", 0, 1): tmp_path / "a.csv", ("car", 15, 4): tmp_path / "b.csv"}
    found = load_folds(files)
    assert list(found.columns) == ["category", "elevation_deg", "fold", *OBJECT_COLUMNS]
    places = found[["category", "elevation_deg", "fold"]].drop_duplicates()
    assert [tuple(row) for row in places.to_numpy().tolist()] == list(files)
    pd.testing.assert_frame_equal(
        found.loc[: len(means) - 1, list(OBJECT_COLUMNS)], means, check_dtype=False
    )
    with pytest.raises(UserError, match=r"c\.csv does not exist"):
        load_folds({("mug", 0, 2): tmp_path / "c.csv"})


def test_differences_are_paired_by_object(sample):
    resampler = Resampler(0, 500)
    alone = mae_interval(sample, "worse", resampler)
    assert alone.value == pytest.approx(np.mean(sample.errors_deg["worse"]))
    found = mae_difference(sample, "worse", "best", resampler)
    assert found.value == pytest.approx(2.0, abs=0.3)
    assert found.low < found.value < found.high
    # What objects do to both methods alike is out of the difference.
    assert found.high - found.low < (alone.high - alone.low) / 3
    back = mae_difference(sample, "best", "worse", resampler)
    assert (back.value, back.low, back.high) == pytest.approx(
        (-found.value, -found.high, -found.low)
    )


def test_what_cannot_be_told_from_the_best(sample):
    resampler = Resampler(0, 500)
    names = indistinct_from_best(sample, ["worse", "close", "best"], resampler)
    assert set(names) == {"best", "close"}
    assert names[0] == min(("best", "close"), key=lambda m: sample.errors_deg[m].mean())
    assert indistinct_from_best(sample, ["worse"], resampler) == ["worse"]


def test_the_same_errors_cannot_be_told_apart_and_a_constant_excess_can():
    errors = np.random.default_rng(0).random(8)
    methods = {"best": errors, "same": errors, "worse": errors + 0.5}
    sample = PairedErrors(methods, np.arange(8), np.ones(8, int), np.zeros(8), ("mug",) * 8)
    assert indistinct_from_best(sample, list(methods), Resampler(0, 100)) == ["best", "same"]


def test_methods_that_an_object_lacks_are_left_out():
    rows = [("all", "a", 1, 1.0), ("all", "b", 1, 2.0), ("some", "a", 1, 3.0)]
    means = pd.DataFrame(rows, columns=["method", "object_id", "fold", "error_deg"])
    sample = paired_objects(means, "mug")
    assert list(sample.errors_deg) == ["all"]
    assert sample.n_objects == 2


def test_an_error_that_is_not_a_number_is_never_the_best():
    rng = np.random.default_rng(0)
    errors = {"good": rng.random(8), "damaged": np.full(8, np.nan)}
    sample = PairedErrors(errors, np.arange(8), np.ones(8, int), np.zeros(8), ("mug",) * 8)
    with pytest.raises(UserError, match="damaged: the MAE is nan"):
        indistinct_from_best(sample, list(errors), Resampler(0, 100))

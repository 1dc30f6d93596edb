"""How likely densities hold the true azimuth, against sums done by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from studies.densities import DensityRun, density_comparison

import synthetic
from conftest import N_FOLDS
from nbv.core.estimates import posteriors_of
from nbv.core.logits import on_degrees
from nbv.errors import UserError
from nbv.experiment.estimates import write_posteriors
from nbv.experiment.report.settings import ReportSettings

UNIT = ("mug", 0)
FOLDS = [(*UNIT, fold) for fold in range(1, N_FOLDS + 1)]
SETTINGS = ReportSettings(n_resamples=200)


@pytest.fixture(scope="module")
def made(tree, evaluations, tmp_path_factory):
    """A regressor's run, and a classifier's whose errors are half as large."""
    folder = tmp_path_factory.mktemp("densities")
    frame = evaluations[UNIT].astype({"method": str})
    first = frame[frame["method"] != "random"]
    named = {"proposed": "gain_product", "random": "opposite_product"}
    products = frame[frame["method"].isin(named)].assign(method=lambda f: f["method"].map(named))
    halves = pd.concat([first, products]).assign(error_deg=lambda f: f["error_deg"] / 2)
    estimates, posteriors = {}, {}
    for place in FOLDS:
        fold = place[-1]
        rows = frame[(frame["method"] == "single") & (frame["fold"] == fold)]
        ids = list(rows["object_id"].unique())
        estimates[place], posteriors[place] = folder / f"{fold}.csv", folder / f"{fold}.npz"
        pd.DataFrame(
            {
                "object_id": rows["object_id"],
                "azimuth_deg": rows["initial_deg"],
                "estimate_deg": rows["initial_estimate_deg"],
            }
        ).to_csv(estimates[place], index=False)
        logits = np.random.default_rng(fold).normal(size=(len(ids), 360, 24))
        write_posteriors(posteriors[place], posteriors_of(ids, logits, 1.0 + fold))
    lookups = synthetic.lookup_files(tree, [UNIT], N_FOLDS)
    runs = {
        "first": DensityRun({UNIT: first}, estimates, lookups),
        "second": DensityRun({UNIT: halves}, estimates, lookups, posteriors),
    }
    return SimpleNamespace(runs=runs, table=density_comparison(runs, SETTINGS))


def test_values_are_means_over_images_of_the_density_at_the_truth(made):
    value = made.table.cells.set_index(["method", "metric"])["value"]
    run = made.runs["second"]
    of_estimate, entropies, tempered, plain = [], [], [], []
    for fold, place in enumerate(FOLDS, start=1):
        V = np.load(run.lookups[place])["viewpoint_likelihood"].astype(float)
        test = pd.read_csv(run.estimates[place])
        for estimate, truth in zip(test["estimate_deg"], test["azimuth_deg"], strict=True):
            row = V[int(np.floor(estimate + 0.5)) % 360]
            of_estimate.append(np.log(row[truth]))
            entropies.append(-(row[row > 0] * np.log(row[row > 0])).sum())
        stored = np.load(run.posteriors[place])["log_posterior"]
        for logs, found in ((stored, tempered), ((fold + 1) * stored, plain)):
            p = np.exp(logs.astype(float))
            spread = on_degrees(p / p.sum(axis=-1, keepdims=True))
            found += list(np.log(np.diagonal(spread, axis1=1, axis2=2)).ravel())
    assert value["first:estimate", "log_likelihood"] == pytest.approx(np.mean(of_estimate))
    assert value["first:estimate", "entropy"] == pytest.approx(np.mean(entropies), abs=1e-4)
    assert value["second:posterior", "log_likelihood"] == pytest.approx(np.mean(tempered))
    assert value["second:as_trained", "log_likelihood"] == pytest.approx(np.mean(plain), abs=1e-6)
    assert ("first:posterior", "entropy") not in value.index
    cells = made.table.cells
    assert (cells["ci_low"] <= cells["value"]).all()
    assert (cells["ci_high"] >= cells["value"]).all()


def test_a_classifiers_errors_are_those_of_the_product(made):
    value = made.table.cells.set_index(["method", "metric"])["value"]
    errors = made.runs["second"].evaluations[UNIT].groupby("method")["error_deg"].mean()
    for metric, method in (("recommended", "gain_product"), ("opposite", "opposite_product")):
        assert value["second:posterior", metric] == pytest.approx(errors[method])
    assert value["second:estimate", "recommended"] == pytest.approx(errors["proposed"])


def test_a_row_for_each_density_that_a_run_has(made):
    rows = [[cell.text for cell in row] for row in made.table.rows]
    assert [row[:3] for row in rows] == [
        ["Mug", "first", "V of the estimate"],
        ["Mug", "second", "V of the estimate"],
        ["Mug", "second", "p(φ given I), as trained"],
        ["Mug", "second", "p(φ given I), at its temperature"],
    ]
    assert [row[4] for row in rows][:2] == ["–", "0.00 (0.00 to 0.00)"]
    assert rows[2][-3:] == ["–", "–", "–"]
    assert made.table.header[4] == "… less that of V, first"
    assert made.table.notes[-1] == "Temperatures of second, mug, by fold: 2.00, 3.00, 4.00."


def test_a_missing_file_is_named(made, tmp_path):
    run = made.runs["first"]
    absent = DensityRun(run.evaluations, dict.fromkeys(FOLDS, tmp_path / "no.csv"), run.lookups)
    with pytest.raises(UserError, match=r"no\.csv does not exist"):
        density_comparison({"first": absent}, SETTINGS)

"""Tables that show runs beside one another: likelihoods and sidebyside."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pytest

from nbv.calibration.estimates import write_estimates
from nbv.calibration.posteriors import on_degrees, write_posteriors
from nbv.errors import UserError
from nbv.reporting.extensions.densities import (
    likelihood_cells,
    likelihoods_markdown,
    temperature_notes,
)
from nbv.reporting.extensions.runs import sidebyside_cells, sidebyside_markdown
from nbv.reporting.settings import ReportSettings as ReadingSettings

UNITS = [("mug", 0)]
N_FOLDS = 3
SETTINGS = ReadingSettings(n_resamples=200)


@pytest.fixture(scope="module")
def runs(tree, tmp_path_factory):
    """Folders of a regressor's run and of a classifier's, whose errors are half as large."""
    folder = tmp_path_factory.mktemp("runs")
    for name in ("first", "second"):
        for stage in ("evaluation", "lookup"):
            shutil.copytree(tree / stage / "mug/el00", folder / name / stage / "mug/el00")
        for fold in range(1, N_FOLDS + 1):
            place = f"mug/el00/fold{fold}"
            single = pd.read_csv(tree / "evaluation" / place / "single.csv", dtype={0: str})
            ids = list(single["object_id"].unique())
            estimate = single["initial_estimate_deg"].to_numpy().reshape(len(ids), 360)
            target = folder / name / "estimates" / place
            write_estimates(target / "test.csv", ids, estimate, np.ones_like(estimate))
            rng = np.random.default_rng(fold)
            logits = rng.normal(size=(len(ids), 360, 24))
            write_posteriors(target / "test_posteriors.npz", ids, logits, 1.0 + fold)
            written = folder / name / "evaluation" / place
            shutil.copy(written / "proposed.csv", written / "belief.csv")
            shutil.copy(written / "random.csv", written / "belief_opposite.csv")
    for path in (folder / "second/evaluation").rglob("*.csv"):
        rows = pd.read_csv(path, dtype={"object_id": str})
        rows.assign(error_deg=rows["error_deg"] / 2).to_csv(path, index=False)
    return folder


def read(folder, stage, name):
    places = [folder / stage / f"mug/el00/fold{fold}" for fold in range(1, N_FOLDS + 1)]
    if name.endswith(".csv"):
        return [pd.read_csv(place / name) for place in places]
    return [dict(np.load(place / name)) for place in places]


def test_likelihoods_are_means_over_images_of_the_density_at_the_truth(runs):
    both = {"first": (runs / "first", False), "second": (runs / "second", True)}
    cells = likelihood_cells(both, UNITS, N_FOLDS, SETTINGS)
    value = cells.set_index(["method", "metric"])["value"]
    of_estimate, entropies, tempered, plain = [], [], [], []
    tests = read(runs / "first", "estimates", "test.csv")
    for fold, (test, table, stored) in enumerate(
        zip(
            tests,
            read(runs / "first", "lookup", "entropy.npz"),
            read(runs / "first", "estimates", "test_posteriors.npz"),
            strict=True,
        ),
        start=1,
    ):
        V = table["viewpoint_likelihood"].astype(float)
        for estimate, truth in zip(test["estimate_deg"], test["azimuth_deg"], strict=True):
            row = V[int(np.floor(estimate + 0.5)) % 360]
            of_estimate.append(np.log(row[truth]))
            entropies.append(-(row[row > 0] * np.log(row[row > 0])).sum())
        for logs, found in (
            (stored["log_posterior"], tempered),
            ((fold + 1) * stored["log_posterior"], plain),
        ):
            p = np.exp(logs.astype(float))
            spread = on_degrees(p / p.sum(axis=-1, keepdims=True))
            found += list(np.log(np.diagonal(spread, axis1=1, axis2=2)).ravel())
    assert value["first:estimate", "log_likelihood"] == pytest.approx(np.mean(of_estimate))
    assert value["first:estimate", "entropy"] == pytest.approx(np.mean(entropies), abs=1e-4)
    assert value["second:posterior", "log_likelihood"] == pytest.approx(np.mean(tempered))
    assert value["second:as_trained", "log_likelihood"] == pytest.approx(np.mean(plain), abs=1e-6)
    for column, name in (("recommended", "belief"), ("opposite", "belief_opposite")):
        errors = pd.concat(read(runs / "second", "evaluation", f"{name}.csv"))["error_deg"]
        assert value["second:posterior", column] == pytest.approx(errors.mean())
    assert ("first:posterior", "entropy") not in value.index
    assert (cells["ci_low"] <= cells["value"]).all()
    assert (cells["ci_high"] >= cells["value"]).all()


def test_likelihoods_for_people(runs):
    both = {"first": (runs / "first", False), "second": (runs / "second", True)}
    cells = likelihood_cells(both, UNITS, N_FOLDS, SETTINGS)
    notes = temperature_notes(both, UNITS, N_FOLDS)
    assert notes == ["Temperatures of second, mug, by fold: 2.00, 3.00, 4.00."]
    text = likelihoods_markdown(cells, notes)
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| Mug")]
    assert [(row[1], row[2]) for row in rows] == [
        ("first", "V of the estimate"),
        ("second", "V of the estimate"),
        ("second", "p(φ given I), as trained"),
        ("second", "p(φ given I), at its temperature"),
    ]
    assert rows[0][4] == "–"
    assert rows[1][4] == "0.00 (0.00 to 0.00)"
    assert all(len(row) == 10 for row in rows)
    assert text.endswith(f"- {notes[0]}\n")


def test_runs_side_by_side_differ_image_by_image(runs):
    known = ["single", "opposite"]
    both = {"first": (runs / "first", known), "second": (runs / "second", [*known, "belief"])}
    cells = sidebyside_cells(both, UNITS, N_FOLDS, SETTINGS).set_index(["row", "method"])
    for method in known:
        errors = pd.concat(read(runs / "first", "evaluation", f"{method}.csv"))["error_deg"]
        first, second = (cells.loc[(f"mug {method}", run)] for run in ("first", "second"))
        assert first["value"] == pytest.approx(errors.mean())
        assert np.isnan(first["difference"])
        assert second["difference"] == pytest.approx(-errors.mean() / 2)
        # Every image's error is halved, and so is each resample's.
        assert second["difference_low"] == pytest.approx(-second["ci_high"])
        assert second["difference_high"] == pytest.approx(-second["ci_low"])
    text = sidebyside_markdown(cells.reset_index())
    assert "| MAE | first | second | second − first |" in text
    belief = next(line for line in text.splitlines() if line.startswith("| Mug: Belief"))
    assert belief.split(" | ")[1] == belief.split(" | ")[3].rstrip(" |") == "–"


def test_runs_that_were_tested_on_other_objects_are_refused(runs, tmp_path):
    shutil.copytree(runs / "second", tmp_path / "other")
    path = tmp_path / "other/evaluation/mug/el00/fold1/single.csv"
    rows = pd.read_csv(path, dtype={"object_id": str})
    rows.assign(object_id=rows["object_id"] + "x").to_csv(path, index=False)
    both = {"first": (runs / "first", ["single"]), "other": (tmp_path / "other", ["single"])}
    with pytest.raises(UserError, match="other was evaluated on other images than first"):
        sidebyside_cells(both, UNITS, N_FOLDS, SETTINGS)

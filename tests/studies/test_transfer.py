"""The table trained on × tested on, against sums and resamples done by hand."""

import itertools

import numpy as np
import pandas as pd
import pytest
from studies.transfer import load_transfer, transfer_table

from nbv.errors import UserError
from nbv.experiment.report.settings import CELL_COLUMNS, ReportSettings
from nbv.experiment.report.table import write_table
from nbv.experiment.results import COLUMNS
from nbv.experiment.run.reference import read_cells

CONDITIONS = {
    "clean": {"sensor": "ideal", "framing": "silhouette"},
    "noisy": {"sensor": "kinect", "framing": "axis"},
}
UNIT = ("mug", 15)
METHODS = ("single", "proposed")
FOLDS = (1, 3)
SETTINGS = ReportSettings(methods=METHODS, n_resamples=200, seed=5)
PAIRS = list(itertools.product(CONDITIONS, CONDITIONS))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Errors of three objects a fold; those of `noisy` under `clean` are the largest."""
    folder = tmp_path_factory.mktemp("transfer")
    rng = np.random.default_rng(0)
    found = {}
    for (trained, tested), fold, method in itertools.product(PAIRS, FOLDS, METHODS):
        scale = 20 if (trained, tested) == ("noisy", "clean") else 10
        frame = pd.DataFrame(0.0, index=range(12), columns=list(COLUMNS))
        frame["object_id"] = np.repeat([f"{fold}{name}" for name in "abc"], 4)
        frame["initial_deg"] = np.tile([0, 90, 180, 270], 3)
        frame["error_deg"] = rng.uniform(0, scale, 12).round(4)
        path = folder / f"{trained}-{tested}-{fold}-{method}.csv"
        frame.to_csv(path, index=False)
        found[trained, tested, fold, method] = path
    return found


@pytest.fixture(scope="module")
def evaluations(files):
    return load_transfer(files, UNIT)


@pytest.fixture(scope="module")
def table(evaluations):
    return transfer_table(evaluations, CONDITIONS, UNIT, SETTINGS)


def errors(evaluations, trained, tested, method):
    frame = evaluations[trained, tested]
    return frame[frame["method"] == method].sort_values(["object_id", "initial_deg"])


def cell(table, trained, tested, method):
    cells = table.cells
    chosen = (cells["trained_on"] == trained) & (cells["tested_on"] == tested)
    (found,) = cells[chosen & (cells["method"] == method)].to_dict("records")
    return found


def test_every_pair_has_its_mean_and_interval(evaluations, table):
    assert len(table.cells) == len(PAIRS) * len(METHODS)
    for (trained, tested), method in itertools.product(PAIRS, METHODS):
        frame = errors(evaluations, trained, tested, method)
        found = cell(table, trained, tested, method)
        assert found["value"] == pytest.approx(frame["error_deg"].mean())
        of_fold = frame.groupby("fold")["error_deg"].mean()
        assert found["sigma"] == pytest.approx(of_fold.std())
        assert (found["n_objects"], found["n_images"]) == (6, 24)
        assert found["ci_low"] < found["value"] < found["ci_high"]


def test_differences_are_paired_with_the_matched_estimator(evaluations, table):
    for (trained, tested), method in itertools.product(PAIRS, METHODS):
        found = cell(table, trained, tested, method)
        if trained == tested:
            assert np.isnan(found["difference"])
            continue
        by_object = [
            errors(evaluations, one, tested, method).groupby("object_id")["error_deg"].mean()
            for one in (trained, tested)
        ]
        gap = (by_object[0] - by_object[1]).to_numpy()
        assert found["difference"] == pytest.approx(gap.mean())
        # All samples of three objects' gaps lie between these.
        assert gap.min() <= found["difference_low"] <= found["difference"]
        assert found["difference"] <= found["difference_high"] <= gap.max()


def test_written_as_other_tables_are(table, tmp_path):
    paths = {kind: tmp_path / f"transfer.{kind}" for kind in ("csv", "md", "tex")}
    write_table(table, paths)
    assert len(read_cells(paths["csv"])) == len(table.cells)
    assert list(pd.read_csv(paths["csv"]).columns) == [*CELL_COLUMNS, "trained_on", "tested_on"]
    rows = [line for line in paths["md"].read_text().splitlines() if line.startswith("|")]
    assert rows[0] == "| Method | Trained on | clean | noisy |"
    assert len(rows) == 2 + len(METHODS) * len(CONDITIONS)
    single, noisy = (row.split(" | ") for row in rows[2:4])
    assert single[0] == "| Single"
    value = cell(table, "clean", "clean", "single")
    assert single[2].startswith(f"**{value['value']:.2f}°** ({value['ci_low']:.2f} to ")
    assert not noisy[2].startswith("**")
    assert "\\begin{tabular}{lrrr}" in paths["tex"].read_text()
    assert "6 test objects, 24 initial views in each row." in table.notes


def test_a_missing_file_is_named(files, tmp_path):
    absent = files | {("clean", "noisy", 3, "single"): tmp_path / "single.csv"}
    with pytest.raises(UserError, match=r"single\.csv does not exist"):
        load_transfer(absent, UNIT)

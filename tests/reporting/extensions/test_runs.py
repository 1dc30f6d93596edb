"""Methods of several runs, image by image."""

from __future__ import annotations

import numpy as np
import pytest

from nbv.errors import UserError
from nbv.reporting.extensions.runs import run_comparison
from nbv.reporting.settings import ReportSettings

from .made import texts

SETTINGS = ReportSettings(n_resamples=200)
SHARED = ["single", "opposite"]


@pytest.fixture(scope="module")
def first(evaluations):
    frame = evaluations["mug", 0].astype({"method": str})
    return frame[frame["method"].isin(SHARED)]


@pytest.fixture(scope="module")
def second(evaluations):
    """Errors half as large, and a method that the first run lacks."""
    frame = evaluations["mug", 0].astype({"method": str})
    frame = frame[frame["method"].isin([*SHARED, "proposed"])]
    return frame.assign(
        error_deg=frame["error_deg"] / 2,
        method=frame["method"].replace({"proposed": "gain_product"}),
    )


def test_runs_differ_image_by_image(first, second):
    runs = {"first": {("mug", 0): first}, "second": {("mug", 0): second}}
    table = run_comparison(runs, SETTINGS)
    cells = table.cells.set_index(["row", "method"])
    for method in SHARED:
        errors = first.loc[first["method"] == method, "error_deg"]
        one, other = (cells.loc[(f"mug {method}", run)] for run in runs)
        assert one["value"] == pytest.approx(errors.mean())
        assert np.isnan(one["difference"])
        assert other["difference"] == pytest.approx(-errors.mean() / 2)
        # Every image's error is halved, and so is each resample's.
        assert other["difference_low"] == pytest.approx(-other["ci_high"])
        assert other["difference_high"] == pytest.approx(-other["ci_low"])
    assert table.header == ("MAE", "first", "second", "second − first")
    missing, value, difference = texts(table)["Mug: Gain product"]
    assert (missing, difference) == ("–", "–")
    assert value.endswith("°")


def test_runs_that_were_tested_on_other_objects_are_refused(first):
    other = first.assign(object_id=first["object_id"] + "x")
    runs = {"first": {("mug", 0): first}, "other": {("mug", 0): other}}
    with pytest.raises(UserError, match="other was evaluated on other images than first"):
        run_comparison(runs, SETTINGS)

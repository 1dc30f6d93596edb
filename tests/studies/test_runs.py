"""Methods of several runs, image by image."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from studies.runs import estimator_comparison, run_comparison

from nbv.core.estimates import Estimates
from nbv.errors import UserError
from nbv.experiment.estimates import write_estimates
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.results import load_estimate_errors

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


UNITS = (("mug", 0), ("mug", 30), ("chair", 0))
ROLES = {"calibration": (("b", "c"), ("a", "c")), "test": (("a",), ("b",))}
N_VIEWS = 8


@pytest.fixture
def estimates(tmp_path, rng):
    """Files of two runs, and their errors: (run, category, elevation, fold, role, object) each."""
    runs: dict[str, dict] = {"cold": {}, "warm": {}}
    errors = []
    for run, files in runs.items():
        for category, elevation in UNITS:
            for role, of_folds in ROLES.items():
                for fold, names in enumerate(of_folds, start=1):
                    wrong = rng.uniform(-90, 90, (len(names), N_VIEWS)).round(2)
                    azimuth = np.arange(N_VIEWS) * 45.0
                    place = (category, elevation, fold, role)
                    path = tmp_path / "-".join(map(str, (run, *place)))
                    write_estimates(path, Estimates(names, (azimuth + wrong) % 360))
                    files[place] = path
                    errors += [
                        (run, *place, name, error)
                        for name, row in zip(names, abs(wrong), strict=True)
                        for error in row
                    ]
    columns = ["run", "category", "elevation", "fold", "role", "object", "error"]
    return runs, pd.DataFrame(errors, columns=columns)


def test_estimators_differ_unit_by_unit_and_pooled(estimates):
    files, errors = estimates
    runs = {run: load_estimate_errors(paths) for run, paths in files.items()}
    table = estimator_comparison(runs, SETTINGS)
    cells = table.cells.set_index(["row", "method"])
    groups = {
        f"{c}/el{e:02d}": (errors["category"] == c) & (errors["elevation"] == e) for c, e in UNITS
    }
    groups |= {"mug": errors["category"] == "mug", "all": errors["category"] != ""}
    assert len(cells) == 2 * 2 * len(groups)
    for name, chosen in groups.items():
        for role in ROLES:
            part = errors[chosen & (errors["role"] == role)]
            means = part.groupby("run")["error"].mean()
            cold, warm = (cells.loc[(f"{name} {role}", run)] for run in runs)
            assert (cold["value"], warm["value"]) == pytest.approx((means["cold"], means["warm"]))
            assert warm["difference"] == pytest.approx(means["warm"] - means["cold"])
            assert warm["difference_low"] <= warm["difference"] <= warm["difference_high"]
            of_objects = part.groupby(["category", "object"]).ngroups
            assert warm["n_objects"] == of_objects
    assert "Mug, all elevations: calibration objects" in texts(table)


def test_a_category_of_one_elevation_alone_has_two_rows(estimates):
    files, _ = estimates
    runs = {
        run: load_estimate_errors({key: path for key, path in paths.items() if key[0] == "chair"})
        for run, paths in files.items()
    }
    rows = list(texts(estimator_comparison(runs, SETTINGS)))
    assert rows == ["Chair: calibration objects", "Chair: test objects"]


def test_an_object_of_all_elevations_is_resampled_as_one(estimates):
    """Twice the same images at two elevations tell no more than once: the interval stays."""
    files, _ = estimates
    same = {
        run: paths | {("mug", 30, *rest): paths["mug", 0, *rest] for _, _, *rest in paths}
        for run, paths in files.items()
    }
    runs = {run: load_estimate_errors(paths) for run, paths in same.items()}
    cells = estimator_comparison(runs, SETTINGS).cells.set_index(["row", "method"])
    numbers = ["value", "difference", "difference_low", "difference_high"]
    for role in ROLES:
        one, both = (cells.loc[(f"{name} {role}", "warm"), numbers] for name in ("mug/el00", "mug"))
        np.testing.assert_allclose(one.to_numpy(float), both.to_numpy(float))

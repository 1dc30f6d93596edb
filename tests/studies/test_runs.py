"""Several runs side by side, image by image."""

import numpy as np
import pandas as pd
import pytest
from studies.runs import files_by_run, load_estimate_errors, runs_table

from method_errors import texts
from nbv.core.circle.estimates import Estimates
from nbv.errors import UserError
from nbv.experiment.estimates import write_estimates
from nbv.experiment.report.settings import ReportSettings

SETTINGS = ReportSettings(n_resamples=200)
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


def side_by_side(files, evaluations=None):
    estimates = {run: load_estimate_errors(paths) for run, paths in files.items()}
    return runs_table(estimates, evaluations or {}, SETTINGS)


def test_single_differs_unit_by_unit_and_pooled(estimates):
    files, errors = estimates
    table = side_by_side(files)
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
            cold, warm = (cells.loc[(f"{name} single {role}", run)] for run in files)
            assert (cold["value"], warm["value"]) == pytest.approx((means["cold"], means["warm"]))
            assert np.isnan(cold["difference"])
            assert warm["difference"] == pytest.approx(means["warm"] - means["cold"])
            assert warm["difference_low"] <= warm["difference"] <= warm["difference_high"]
            of_objects = part.groupby(["category", "object"]).ngroups
            assert warm["n_objects"] == of_objects
    assert "Mug, all elevations: Single, calibration objects" in texts(table)


def test_a_category_of_one_elevation_alone_has_a_row_for_each_role(estimates):
    files, _ = estimates
    rows = list(texts(side_by_side(of_unit(files, ("chair", 0)))))
    assert rows == ["Chair: Single, calibration objects", "Chair: Single, test objects"]


def test_an_object_of_all_elevations_is_resampled_as_one(estimates):
    """Twice the same images at two elevations tell no more than once: the interval stays."""
    files, _ = estimates
    same = {
        run: paths | {("mug", 30, *rest): paths["mug", 0, *rest] for _, _, *rest in paths}
        for run, paths in files.items()
    }
    cells = side_by_side(same).cells.set_index(["row", "method"])
    numbers = ["value", "difference", "difference_low", "difference_high"]
    for role in ROLES:
        one, both = (
            cells.loc[(f"{name} single {role}", "warm"), numbers] for name in ("mug/el00", "mug")
        )
        np.testing.assert_allclose(one.to_numpy(float), both.to_numpy(float))


def of_unit(files, unit):
    return {
        run: {key: path for key, path in paths.items() if key[:2] == unit}
        for run, paths in files.items()
    }


def test_methods_differ_image_by_image(estimates, evaluations):
    """The second run's errors are half as large, and it has a method that the first one lacks."""
    files, _ = estimates
    frame = evaluations["mug", 0].astype({"method": str})
    opposite = frame[frame["method"] == "opposite"]
    more = frame[frame["method"].isin(["opposite", "proposed"])]
    more = more.assign(
        error_deg=more["error_deg"] / 2,
        method=more["method"].replace({"proposed": "gain_product"}),
    )
    methods = {"cold": {("mug", 0): opposite}, "warm": {("mug", 0): more}}
    table = side_by_side(of_unit(files, ("mug", 0)), methods)
    cells = table.cells.set_index(["row", "method"])
    mean = opposite["error_deg"].mean()
    cold, warm = (cells.loc[("mug/el00 opposite test", run)] for run in files)
    assert cold["value"] == pytest.approx(mean)
    assert warm["difference"] == pytest.approx(-mean / 2)
    # Every image's error is halved, and so is each resample's.
    assert warm["difference_low"] == pytest.approx(-warm["ci_high"])
    assert warm["difference_high"] == pytest.approx(-warm["ci_low"])
    assert table.header == ("MAE", "cold", "warm", "warm − cold")
    missing, value, difference = texts(table)["Mug: Gain product, test objects"]
    assert (missing, difference) == ("–", "–")
    assert value.endswith("°")


def test_runs_that_were_tested_on_other_objects_are_refused(estimates, evaluations):
    files, _ = estimates
    frame = evaluations["mug", 0].astype({"method": str})
    opposite = frame[frame["method"] == "opposite"]
    other = opposite.assign(object_id=opposite["object_id"] + "x")
    methods = {"cold": {("mug", 0): opposite}, "warm": {("mug", 0): other}}
    with pytest.raises(UserError, match="warm was evaluated on other images than cold"):
        side_by_side(of_unit(files, ("mug", 0)), methods)


def test_files_are_told_apart_by_run():
    keys = [("one", "mug", 1), ("two", "mug", 1), ("one", "mug", 2)]
    assert files_by_run(keys, ["a", "b", "c"]) == {
        "one": {("mug", 1): "a", ("mug", 2): "c"},
        "two": {("mug", 1): "b"},
    }

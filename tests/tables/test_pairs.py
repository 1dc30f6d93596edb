"""Calibration pairs of any estimator, from a CSV file."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nbv.core.circle.angles import circular_distance_deg, wrap_deg
from nbv.core.circle.estimates import Estimates
from nbv.core.circle.selection import DENSITY
from nbv.core.circle.sweeps import N_VIEWS, WIDEST_GAP_DEG
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.estimates import write_estimates
from nbv.labels import counted
from nbv.tables.pairs import PairTable

CONFIG = Path(__file__).parents[2] / "config"


def written(path: Path, objects) -> Path:
    """Pairs of several objects: names to (azimuths, estimates)."""
    rows = [
        (name, azimuth, estimate)
        for name, (azimuths, estimates) in objects.items()
        for azimuth, estimate in zip(azimuths, estimates, strict=True)
    ]
    table = pd.DataFrame(rows, columns=["object_id", "azimuth_deg", "estimate_deg"])
    table.to_csv(path, index=False)
    return path


def estimates_of(seed: int, azimuths) -> np.ndarray:
    return wrap_deg(np.asarray(azimuths) + np.random.default_rng(seed).normal(0, 20, len(azimuths)))


def refused(path: Path) -> str:
    with pytest.raises(UserError, match=path.name) as error:
        assert PairTable.load(path).estimates
    assert "\n" not in str(error.value)
    return str(error.value)


def test_the_density_is_that_of_the_paper():
    config = load_config(CONFIG)
    assert {**config["density"], **config["recommendation"]} == dict(DENSITY)


def test_views_a_degree_apart_come_back_as_they_are(tmp_path):
    views = np.arange(360)
    wanted = np.stack([estimates_of(seed, views) for seed in range(3)])
    path = written(tmp_path / "p.csv", {f"o{i}": (views, row) for i, row in enumerate(wanted)})
    found = PairTable.load(path).estimates.estimate_deg
    assert found.shape == (3, N_VIEWS)
    assert np.array_equal(found, wanted)


def test_estimates_of_the_experiments_are_pairs(tmp_path):
    wanted = np.stack([estimates_of(seed, np.arange(360)) for seed in range(2)]).round(4) % 360
    write_estimates(tmp_path / "e.csv", Estimates(("a", "b"), wanted))
    assert np.array_equal(PairTable.load(tmp_path / "e.csv").estimates.estimate_deg, wanted)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6))
def test_the_order_of_rows_does_not_matter(tmp_path_factory, seed):
    folder, rng = tmp_path_factory.mktemp("pairs"), np.random.default_rng(seed)
    views = np.arange(0, 360, 5)
    objects = {name: (views, estimates_of(i, views)) for i, name in enumerate("ab")}
    wanted = PairTable.load(written(folder / "p.csv", objects)).estimates.estimate_deg
    table = pd.read_csv(folder / "p.csv")
    table.iloc[rng.permutation(len(table))].to_csv(folder / "q.csv", index=False)
    found = PairTable.load(folder / "q.csv").estimates.estimate_deg
    # Objects come in the order of the file.
    first = pd.read_csv(folder / "q.csv")["object_id"][0]
    assert np.array_equal(found, wanted if first == "a" else wanted[::-1])


@pytest.mark.parametrize("step", [1, 2, 3, 5, 7.5, 10, 15])
@pytest.mark.parametrize("offset", [0.0, 0.1, 0.4, 3.0])
def test_views_farther_apart_keep_their_errors(tmp_path, step, offset):
    views = np.arange(0, 360, step) + offset
    estimates = estimates_of(1, views)
    found = PairTable.load(
        written(tmp_path / "p.csv", {"a": (views, estimates)})
    ).estimates.estimate_deg[0]
    errors = (estimates - views + 180) % 360 - 180
    assert ((found >= 0) & (found < 360)).all()
    for azimuth, estimate in enumerate(found):
        apart = circular_distance_deg(views, azimuth)
        tied = np.flatnonzero(apart < apart.min() + 1e-6)
        error = (estimate - azimuth + 180) % 360 - 180
        assert min(circular_distance_deg(error, errors[tied])) < 1e-6


@given(base=st.integers(-720, 720), shift=st.integers(-720, 720))
def test_whole_turns_do_not_matter(tmp_path_factory, base, shift):
    folder = tmp_path_factory.mktemp("pairs")
    views = np.arange(0, 360, 10)
    estimates = estimates_of(2, views)
    one = PairTable.load(
        written(folder / "p.csv", {"a": (views, estimates)})
    ).estimates.estimate_deg
    moved = {"a": (views + 360 * (base // 360), estimates + 360 * (shift // 360))}
    assert PairTable.load(written(folder / "q.csv", moved)).estimates.estimate_deg == pytest.approx(
        one, abs=1e-6
    )


def test_objects_may_have_other_views_and_any_names(tmp_path):
    views = np.arange(0, 360, 15), np.arange(0, 360, 4)
    objects = {"NA": (views[0], views[0] + 5.0), "007": (views[1], views[1] - 3.0)}
    found = PairTable.load(written(tmp_path / "p.csv", objects)).estimates.estimate_deg
    errors = (found - np.arange(360) + 180) % 360 - 180
    assert errors[0] == pytest.approx(5.0)
    assert errors[1] == pytest.approx(-3.0)


def test_further_columns_are_ignored(tmp_path):
    views = np.arange(0, 360, 15)
    path = written(tmp_path / "p.csv", {"a": (views, views)})
    wanted = PairTable.load(path).estimates.estimate_deg
    pd.read_csv(path).assign(note="", score=np.nan).to_csv(path, index=False)
    assert np.array_equal(PairTable.load(path).estimates.estimate_deg, wanted)


def test_any_azimuths_calibrate_and_what_is_thin_is_said(tmp_path):
    azimuth, estimate = np.array([10.5, 100.0, 100.0]), np.array([12.5, 100.0, 280.0])
    views = np.arange(0, 360, 5)
    path = written(tmp_path / "p.csv", {"thin": (azimuth, estimate), "whole": (views, views)})
    estimates, (warning,) = PairTable.load(path).thin_estimates
    error = (estimates.estimate_deg[0] - np.arange(360)) % 360
    assert set(error[90:120]) == {0.0, 180.0}  # both views at one azimuth count
    assert error[90:120].mean() == 90
    assert np.allclose(error[[11, 340]], 2)
    assert "1 of 2 objects" in warning
    assert "'thin' one of 270°" in warning
    path = written(tmp_path / "q.csv", {"whole": (views, views)})
    table = PairTable.load(path)
    assert not table.thin_estimates[1]
    assert np.array_equal(table.thin_estimates[0].estimate_deg, table.estimates.estimate_deg)


# What is refused


@pytest.mark.parametrize(
    ("views", "gap"),
    [
        ([0, 90, 180, 270], 90),
        (range(0, 345, 5), 20),
        (np.arange(0, 352, WIDEST_GAP_DEG + 1), 24),
    ],
)
def test_a_gap_is_refused(tmp_path, views, gap):
    views, full = np.asarray(views, dtype=float), np.arange(360)
    path = written(tmp_path / "p.csv", {"whole": (full, full), "half": (views, views)})
    message = refused(path)
    assert "'half'" in message
    assert f"{gap}°" in message


@pytest.mark.parametrize("first", [0, -180])
def test_azimuths_in_radians_are_named(tmp_path, first):
    views = np.arange(first, first + 360)
    path = written(tmp_path / "p.csv", {"a": (np.radians(views), np.radians(views))})
    assert "these azimuths seem to be radians: multiply them by 180/π" in refused(path)
    sweep = np.radians(np.arange(first, first + 360, 15)).round(2)
    path = written(tmp_path / "p.csv", {"a": (sweep, sweep)})
    assert "180/π" in refused(path)
    for few in (views[:10], np.arange(7), np.zeros(1)):
        path = written(tmp_path / "p.csv", {"a": (few, few)})
        assert "180/π" not in refused(path)


@pytest.mark.parametrize("value", ["", "nan", "inf", "north", "1e999", "1e300", "2,4", "12°"])
@pytest.mark.parametrize("column", ["azimuth_deg", "estimate_deg"])
def test_what_is_no_number_is_named_with_its_row(tmp_path, value, column):
    views = np.arange(0, 360, 10)
    table = pd.read_csv(written(tmp_path / "p.csv", {"a": (views, views)})).astype(object)
    table.loc[7, column] = value
    table.to_csv(tmp_path / "p.csv", index=False)
    # Row 1 has the names of the columns.
    wanted = f"row 9: {column} {value!r} is not "
    assert wanted in refused(tmp_path / "p.csv")


@pytest.mark.parametrize("column", ["object_id", "azimuth_deg", "estimate_deg"])
def test_a_missing_column_is_named(tmp_path, column):
    views = np.arange(0, 360, 10)
    path = written(tmp_path / "p.csv", {"a": (views, views)})
    pd.read_csv(path).drop(columns=column).to_csv(path, index=False)
    message = refused(path)
    assert f"no column '{column}'" in message
    assert "object_id, azimuth_deg, estimate_deg" in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "p.csv is empty; it needs object_id, azimuth_deg, estimate_deg"),
        (b"object_id,azimuth_deg,estimate_deg\n", "p.csv has no rows"),
        ("a,b\r\ncup,1\r\nTässchen,2".encode("latin-1"), "p.csv, line 3: this is not UTF-8"),
        (b"a,b\n1,2\n1,2,3\n", "row 3: 3 values and the head has 2"),
        (b'a,b\n"1,2\n3', "a cell has an opening quote and no closing one"),
    ],
)
def test_a_file_that_is_no_table_is_one_line(tmp_path, content, message):
    (tmp_path / "p.csv").write_bytes(content)
    assert message in refused(tmp_path / "p.csv")


@pytest.mark.parametrize("name", ["", "  "])
def test_an_object_without_a_name_is_told_with_its_row(tmp_path, name):
    views = np.arange(0, 360, 10)
    path = written(tmp_path / "p.csv", {"a": (views, views), name: (views, views)})
    assert "row 38: object_id is empty" in refused(path)


def test_a_missing_file_is_named(tmp_path):
    assert "does not exist" in refused(tmp_path / "p.csv")


# Categories and elevations in one file


def units(tmp_path, rows=()) -> Path:
    """Two categories at two elevations, an object `a` in each of them, and further rows."""
    views = np.arange(0, 360, 10)
    table = [
        (category, elevation, "a", view, (view + 10 * elevation + shift) % 360)
        for category, shift in (("mug", 0), ("cup", 1))
        for elevation in (0, 15)
        for view in views
    ]
    names = ["category", "elevation_deg", "object_id", "azimuth_deg", "estimate_deg"]
    pd.DataFrame([*table, *rows], columns=names).to_csv(tmp_path / "units.csv", index=False)
    return tmp_path / "units.csv"


@pytest.mark.parametrize(("category", "shift"), [("mug", 0), ("cup", 1)])
@pytest.mark.parametrize("elevation", [0, 15])
def test_rows_of_one_category_and_elevation_are_read(tmp_path, category, shift, elevation):
    found = PairTable.load(units(tmp_path)).for_unit(category, elevation).estimates
    assert found.object_ids == ("a",)
    wanted = (np.arange(360) + 10 * elevation + shift) % 360
    assert np.array_equal(found.estimate_deg[0], wanted)


def test_the_objects_of_each_category_are_those_of_all_its_elevations(tmp_path):
    views = np.arange(0, 360, 10)
    more = [("mug", elevation, "b", view, view) for elevation in (0, 15) for view in views]
    path = units(tmp_path, more)
    found = PairTable.load(path).objects({"mug": [0, 15], "cup": [0]})
    assert found == {"mug": ["a", "b"], "cup": ["a"]}


def test_an_object_that_is_missing_at_an_elevation_is_one_line(tmp_path):
    more = [("mug", 0, "b", view, view) for view in np.arange(0, 360, 10)]
    with pytest.raises(UserError, match="object 'b' lacks pairs at an elevation of mug"):
        PairTable.load(units(tmp_path, more)).objects({"mug": [0, 15]})
    assert PairTable.load(units(tmp_path, more)).objects({"mug": [0]}) == {"mug": ["a", "b"]}


@pytest.mark.parametrize("absent", ["category", "elevation_deg"])
def test_units_that_nothing_tells_apart_are_one_line(tmp_path, absent):
    path = units(tmp_path)
    pd.read_csv(path).drop(columns=absent).drop_duplicates("azimuth_deg").to_csv(path, index=False)
    with pytest.raises(UserError, match=f"no column '{absent}', and the run has 2"):
        PairTable.load(path).objects({"mug": [0, 15], "cup": [0]})
    if absent == "category":
        assert PairTable.load(path).objects({"mug": [0]}) == {"mug": ["a"]}


def test_a_category_without_rows_is_one_line(tmp_path):
    with pytest.raises(UserError, match="no rows with category=chair"):
        PairTable.load(units(tmp_path)).for_unit("chair", 0)


def test_a_compressed_file_is_read_as_the_file_itself(tmp_path):
    table = pd.DataFrame({"object_id": "a", "azimuth_deg": np.arange(0, 360, 15)})
    table["estimate_deg"] = table["azimuth_deg"] + 1.0
    for name in ("p.csv", "p.csv.gz"):
        table.to_csv(tmp_path / name, index=False)
    plain, packed = (PairTable.load(tmp_path / name).estimates for name in ("p.csv", "p.csv.gz"))
    assert np.array_equal(plain.estimate_deg, packed.estimate_deg)


@pytest.mark.parametrize("strange", [-1, 999])
@pytest.mark.parametrize("others", [[], [5, 200], [-2], [361], [-170, -10, 20], [0, 360]])
def test_an_estimate_that_stands_out_and_repeats_is_told(strange, others):
    rows = pd.DataFrame({"estimate_deg": [strange, strange, *others]})
    is_alone = all(0 <= other <= 360 or (other < 0) != (strange < 0) for other in others)
    told = "".join(PairTable(Path("p.csv"), rows).repeated)
    assert (
        told.startswith(f"2 of {counted(len(rows), 'estimate')} are exactly {strange}") == is_alone
    )

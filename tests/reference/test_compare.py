from __future__ import annotations

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import N_FOLDS
from nbv.config import read_configuration
from nbv.errors import UserError
from nbv.files import write_csv
from nbv.paper.verdicts import evaluate_claims
from nbv.reference.compare import (
    IDENTICAL,
    OUTSIDE,
    UNJUDGED,
    WITHIN,
    _judge,
    compare_runs,
    sigma_ratio,
)
from nbv.reference.store import (
    UNSET,
    collect_reference,
    differing_settings,
    find_reference,
    read_cells,
)
from nbv.reporting.paper.layout import save_table
from nbv.reporting.paper.tables import TABLES, build_table
from nbv.reporting.settings import ReportSettings

CONFIGURATION = f"""\
experiment: synthetic
name: synthetic
n_folds: {N_FOLDS}
dataset:
  source: procedural
  root: null
estimator:
  epochs: 8
  precision: auto
"""


@pytest.fixture(scope="module")
def finished(evaluations, tmp_path_factory):
    """A run as far as it is compared or kept."""
    root = tmp_path_factory.mktemp("compare") / "synthetic"
    settings = ReportSettings(n_resamples=100)
    for name in TABLES:
        save_table(build_table(name, evaluations, settings), root / "tables" / name)
    claims = evaluate_claims(evaluations, np.random.default_rng(0), 100)
    write_csv(root / "claims.csv", claims)
    (root / "claims.md").write_text("claims\n")
    (root / "configuration.yaml").write_text(CONFIGURATION)
    packages = {"numpy": "2.4.0", "torch": "2.13.0"}
    (root / "provenance.json").write_text(json.dumps({"commit": "0123", "packages": packages}))
    (root / "figures").mkdir()
    for name in ("pea.png", "pea.pdf", "figure8.png"):
        (root / "figures" / name).write_bytes(name.encode())
    for kind in ("csv", "md"):
        (root / "tables" / f"runtime.{kind}").write_text("rule,jobs\n")
    return root


@pytest.fixture
def run(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "run")


def change(run, table, row, method, **columns):
    """Overwrite columns of one cell; a callable is given the cell."""
    path = run / "tables" / f"{table}.csv"
    cells = pd.read_csv(path, dtype={"row": str})
    chosen = (cells["row"] == row) & (cells["method"] == method)
    index = cells.index[chosen][0]
    for name, value in columns.items():
        cells.loc[index, name] = value(cells.loc[index]) if callable(value) else value
    cells.to_csv(path, index=False)


def drop(run, table, chosen):
    path = run / "tables" / f"{table}.csv"
    cells = pd.read_csv(path, dtype={"row": str})
    cells[~chosen(cells)].to_csv(path, index=False)


def status(comparison, table, row, method, quantity="value"):
    cells = comparison.cells
    chosen = (cells["table"] == table) & (cells["row"] == row) & (cells["method"] == method)
    return cells.loc[chosen & (cells["quantity"] == quantity), "status"].iloc[0]


def test_a_run_agrees_with_itself(finished, run):
    comparison = compare_runs(finished, run)
    assert comparison.agrees
    assert (comparison.problems, comparison.remarks, comparison.settings) == ((), (), ())
    assert set(comparison.cells["status"]) == {IDENTICAL}
    written = sum(len(pd.read_csv(finished / "tables" / f"{name}.csv")) for name in TABLES)
    assert comparison.lines()[0].startswith(f"{written} cells")
    assert f"{written} cells identical, 0 within their tolerance, 0 outside" in (
        comparison.summary_line()
    )
    assert comparison.lines()[-1] == f"{run} agrees with {finished}"


def test_a_table_made_on_request_may_be_missing(finished, run):
    shutil.copy(run / "tables/table1.csv", run / "tables/transfer.csv")
    comparison = compare_runs(run, finished)
    assert comparison.agrees
    assert comparison.remarks == ("transfer: missing",)


def test_settings_that_no_table_of_every_run_depends_on():
    sizes = {"parameters": {}, "diagonal_m": {"mug": 0.17}}
    before = {"sensor": {"name": "ideal"}}
    after = {"sensor": {"name": "ideal", **sizes}, "transfer": {"folds": [1]}}
    assert differing_settings(before, after) == ()
    kinect = {"sensor": {"name": "kinect", **sizes}}
    other = {"sensor": {"name": "kinect", **sizes, "diagonal_m": {"mug": 0.2}}}
    assert differing_settings(kinect, other) == (("sensor.diagonal_m.mug", 0.17, 0.2),)


@pytest.mark.parametrize("side", ["ci_low", "ci_high"])
def test_a_value_may_move_within_its_interval(finished, run, side):
    change(run, "table1", "mug", "proposed", value=lambda cell: cell[side])
    comparison = compare_runs(finished, run)
    assert comparison.agrees
    assert status(comparison, "table1", "mug", "proposed") == WITHIN
    assert "1 within their tolerance, 0 outside" in comparison.summary_line()


@pytest.mark.parametrize(("side", "step"), [("ci_low", -0.01), ("ci_high", 0.01)])
def test_a_value_that_leaves_its_interval_is_named(finished, run, side, step):
    change(run, "table2", "30", "opposite", value=lambda cell: cell[side] + step)
    comparison = compare_runs(finished, run)
    assert not comparison.agrees
    assert status(comparison, "table2", "30", "opposite") == OUTSIDE
    cell = pd.read_csv(finished / "tables" / "table2.csv", dtype={"row": str})
    cell = cell[(cell["row"] == "30") & (cell["method"] == "opposite")].iloc[0]
    (line,) = comparison.problems
    assert line == (
        f"table2, 30°, Opposite, MAE: {cell[side] + step:.2f}, reference {cell['value']:.2f} "
        f"(tolerance {cell['ci_low']:.2f} to {cell['ci_high']:.2f})"
    )
    assert comparison.lines()[-1].endswith(f"does not agree with {finished}")


EIGHTHS = st.integers(1, 24).map(lambda n: n / 8)


# Shifts that are never a whole number of eighths, so that no rounding decides.
@given(st.integers(-48, 48).map(lambda n: n / 8 + 0.01), EIGHTHS, EIGHTHS)
def test_figures_agree_by_the_intervals_of_both(finished, shift, below, above):
    theirs = read_cells(finished / "tables" / "table1.csv")["mug", "proposed", "mae"]
    moved = {"value": theirs["value"] + shift, "difference": theirs["difference"] + shift}
    mine = theirs | moved
    for name, figure in (("ci", "value"), ("difference", "difference")):
        mine |= {f"{name}_low": moved[figure] - below, f"{name}_high": moved[figure] + above}
    judged = _judge(theirs, mine, 3.0)
    found = {row["quantity"]: row["status"] != OUTSIDE for row in judged}
    # Whether one value lies in the other's interval, whether two intervals have a common point.
    here_in_theirs = theirs["ci_low"] <= mine["value"] <= theirs["ci_high"]
    theirs_in_mine = mine["ci_low"] <= theirs["value"] <= mine["ci_high"]
    assert found["value"] == (here_in_theirs or theirs_in_mine)
    lowest_high = min(mine["difference_high"], theirs["difference_high"])
    assert found["difference"] == (
        lowest_high >= max(mine["difference_low"], theirs["difference_low"])
    )


def test_a_paired_difference_apart_from_the_references_is_named(finished, run):
    columns = ("difference", "difference_low", "difference_high")
    change(run, "table5", "2", "proposed", **dict.fromkeys(columns, 90.0))
    comparison = compare_runs(finished, run)
    assert len(comparison.problems) == 1
    assert "Proposed, MAE paired difference: 90.00" in comparison.problems[0]


def test_the_spread_over_folds_may_differ_by_a_factor(finished, run):
    factor = sigma_ratio(N_FOLDS)
    change(run, "table1", "mug", "single", sigma=lambda cell: cell["sigma"] * factor * 0.99)
    change(run, "table7", "sigma", "single", value=lambda cell: cell["value"] / factor * 1.01)
    assert compare_runs(finished, run).agrees
    change(run, "table1", "mug", "single", sigma=lambda cell: cell["sigma"] * 1.02)
    change(run, "table7", "sigma", "single", value=lambda cell: cell["value"] * 0.98)
    one, other = compare_runs(finished, run).problems
    assert one.startswith("table1, Mug, Single, MAE σ over folds: ")
    assert other.startswith("table7, σ, Single, MAE: ")


def test_the_factor_is_that_of_two_independent_sets_of_folds(rng):
    assert sigma_ratio(5) == pytest.approx(3.099, abs=1e-3)
    for n_folds in (3, 5):
        drawn = np.std(rng.normal(size=(2, 40_000, n_folds)), axis=2, ddof=1)
        ratio = drawn[0] / drawn[1]
        factor = sigma_ratio(n_folds)
        assert np.mean((ratio > 1 / factor) & (ratio < factor)) == pytest.approx(0.95, abs=0.005)


def test_examples_are_not_judged(finished, run):
    change(run, "table6", "0", "proposed", value=179.0)
    comparison = compare_runs(finished, run)
    assert comparison.agrees
    assert status(comparison, "table6", "0", "proposed") == UNJUDGED
    assert "0 outside, 1 of examples not judged" in comparison.summary_line()


def test_a_value_that_became_absent_is_named(finished, run):
    change(run, "table3", "chair", "random", value=np.nan)
    (line,) = compare_runs(finished, run).problems
    assert line.startswith("table3, Chair, Random, pAUC: –, reference")


def test_other_numbers_of_objects_are_named_once_a_row(finished, run):
    for method in ("single", "random"):
        change(run, "table1", "chair", method, n_objects=8)
    assert compare_runs(finished, run).problems == ("table1, Chair: 8 test objects, reference 9",)


def test_what_is_missing_is_named(finished, run):
    (run / "tables" / "table4.csv").unlink()
    (run / "figures" / "pea.png").unlink()
    drop(run, "table1", lambda cells: cells["row"] == "chair")
    drop(run, "table2", lambda cells: cells["method"] == "random")
    drop(run, "table5", lambda cells: (cells["row"] == "3") & (cells["method"] == "single"))
    assert compare_runs(finished, run).problems == (
        "table1, row Chair: missing",
        "table2, method Random: missing",
        "table4: missing",
        "table5, 3 (135–224°), Single, MAE: missing",
        "figures/pea.png: missing",
    )
    # The other way round it is more than the reference has, which is no fault.
    comparison = compare_runs(run, finished)
    assert comparison.agrees
    assert "table1, row Chair: not in the reference" in comparison.remarks


def set_verdict(run, verdict):
    claims = pd.read_csv(run / "claims.csv")
    claims.loc[claims["id"] == "two-views", "verdict"] = verdict
    claims.to_csv(run / "claims.csv", index=False)


@pytest.mark.parametrize(
    ("before", "after", "agrees"),
    [
        ("holds", "does not hold", False),
        ("does not hold", "holds", False),
        ("holds", "undecided", True),
        ("undecided", "does not hold", True),
    ],
)
def test_a_claim_turned_round_is_a_failure_and_any_change_is_told(
    finished, run, tmp_path, before, after, agrees
):
    reference = shutil.copytree(finished, tmp_path / "reference")
    set_verdict(reference, before)
    set_verdict(run, after)
    comparison = compare_runs(reference, run)
    assert comparison.agrees == agrees
    told = comparison.remarks if agrees else comparison.problems
    assert told == (f"claim two-views: {after}, reference {before}",)


def test_a_claim_that_is_missing_is_named(finished, run):
    claims = pd.read_csv(run / "claims.csv")
    claims[claims["id"] != "groups"].to_csv(run / "claims.csv", index=False)
    assert compare_runs(finished, run).problems == ("claim groups: missing",)


def test_other_settings_come_first_and_speak_against_agreement(finished, run):
    text = CONFIGURATION.replace("epochs: 8", "epochs: 4") + "seed: 3\n"
    (run / "configuration.yaml").write_text(text)
    comparison = compare_runs(finished, run)
    assert not comparison.agrees
    assert comparison.problems == ()
    assert comparison.settings == (("estimator.epochs", 8, 4), ("seed", UNSET, 3))
    first = comparison.lines()[0]
    assert first == comparison.settings_line()
    assert first.endswith(": estimator.epochs=4 (reference: 8), seed=3 (reference: not set)")
    assert "cells identical" in comparison.lines()[1]


def test_a_key_that_is_younger_than_the_reference_has_its_default_there():
    assert differing_settings({}, {"calibration": "holdout", "beside": ["other"]}) == ()
    changed = ("calibration", "holdout", "crossfit")
    assert differing_settings({}, {"calibration": "crossfit"}) == (changed,)
    younger = {"estimator": {"n_classes": 72}}
    assert differing_settings({"estimator": {}}, younger) == (("estimator.n_classes", None, 72),)


def test_names_paths_hardware_and_versions_are_only_mentioned(finished, run):
    text = CONFIGURATION.replace("name: synthetic", "name: other")
    text = text.replace("root: null", "root: /data").replace("auto", "float32")
    (run / "configuration.yaml").write_text(text)
    packages = {"numpy": "2.5.0", "torch": "2.13.0"}
    (run / "provenance.json").write_text(json.dumps({"commit": "0123", "packages": packages}))
    comparison = compare_runs(finished, run)
    assert comparison.agrees
    assert comparison.remarks == (
        "made with: name=other (reference: synthetic), dataset.root=/data (reference: None), "
        "estimator.precision=float32 (reference: auto), numpy=2.5.0 (reference: 2.4.0)",
    )


@given(
    st.dictionaries(st.sampled_from("abc"), st.integers(0, 2)),
    st.dictionaries(st.sampled_from("abc"), st.integers(0, 2)),
)
def test_settings_differ_where_either_side_says_otherwise(a, b):
    found = {key: (x, y) for key, x, y in differing_settings({"in": a}, {"in": b})}
    for key in "abc":
        x, y = a.get(key, UNSET), b.get(key, UNSET)
        assert (f"in.{key}" in found) == (x != y)
        assert found.get(f"in.{key}", (x, y)) == (x, y)


@pytest.mark.parametrize("name", ["configuration.yaml", "claims.csv"])
def test_folders_that_are_no_runs_are_named(finished, run, name):
    (run / name).unlink()
    for pair in ((finished, run), (run, finished)):
        with pytest.raises(UserError, match=f"{name} does not exist"):
            compare_runs(*pair)


def test_a_broken_reference_is_named(finished, run):
    (run / "configuration.yaml").write_text("n_folds: 1\n")
    with pytest.raises(UserError, match="n_folds has to be 2 or more"):
        compare_runs(run, finished)
    (run / "configuration.yaml").write_text(CONFIGURATION)
    (run / "tables" / "table1.csv").write_text("row,method\n")
    with pytest.raises(UserError, match=r"table1\.csv: no column 'table'"):
        compare_runs(run, finished)
    shutil.rmtree(run / "tables")
    with pytest.raises(UserError, match="holds no tables"):
        compare_runs(run, finished)


def files(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_reference_keeps_what_a_reviewer_reads(finished, tmp_path):
    reference = tmp_path / "docs" / "reference" / "synthetic"
    written = collect_reference(finished, reference)
    kept, run = files(reference), files(finished)
    assert {str(path.relative_to(reference)) for path in written} == set(kept)
    expected = {f"tables/{name}.{kind}" for name in TABLES for kind in ("csv", "md", "tex")}
    expected |= {"figures/pea.png", "figures/figure8.png", "claims.csv", "claims.md"}
    expected |= {"runtime.csv", "runtime.md", "configuration.yaml", "provenance.json"}
    assert set(kept) == expected
    for name, content in kept.items():
        assert content == run[f"tables/{name}" if name.startswith("runtime") else name]
    assert compare_runs(reference, finished).agrees


def test_a_reference_made_again_loses_what_the_run_has_not(run, tmp_path, caplog):
    reference = tmp_path / "reference"
    (run.parent / "bench.json").write_text("[]\n")
    collect_reference(run, reference)
    assert (reference.parent / "bench.json").read_text() == "[]\n"
    assert "clean commit" not in caplog.text
    (run.parent / "bench.json").unlink()
    (reference / "README.md").write_text("kept\n")
    for kind in ("csv", "md", "tex"):
        (run / "tables" / f"table7.{kind}").unlink()
    (run / "figures" / "pea.png").unlink()
    (run / "provenance.json").write_text(json.dumps({"commit": "0123-dirty"}))
    collect_reference(run, reference)
    kept = files(reference)
    assert not any("table7" in name or "pea" in name for name in kept)
    assert {"README.md", "tables/table1.csv"} <= set(kept)
    assert "not made at a clean commit but at 0123-dirty" in caplog.text


@pytest.mark.parametrize("name", ["claims.md", "tables/runtime.csv", "figures/*.png"])
def test_an_unfinished_run_leaves_the_reference_as_it_was(run, finished, tmp_path, name):
    reference = tmp_path / "reference"
    collect_reference(finished, reference)
    before = files(reference)
    (run / "claims.csv").write_text("other\n")
    for path in run.glob(name):
        path.unlink()
    with pytest.raises(UserError, match="finish the run first"):
        collect_reference(run, reference)
    assert files(reference) == before


def test_a_name_without_a_reference_is_told_those_there_are(finished, tmp_path):
    with pytest.raises(UserError, match="there is none yet"):
        find_reference(tmp_path / "reference", {"name": "quick"})
    collect_reference(finished, tmp_path / "reference" / "paper")
    with pytest.raises(UserError, match=r"'quick' cannot be compared \(there are: paper\)"):
        find_reference(tmp_path / "reference", {"name": "quick"})


def test_other_settings_are_told_before_a_run_is_made(finished, tmp_path):
    reference = tmp_path / "synthetic"
    collect_reference(finished, reference)
    configuration = read_configuration(finished)
    assert find_reference(tmp_path, configuration) == reference
    with pytest.raises(UserError, match=r"other settings than .*: seed=3 \(reference: not set\)$"):
        find_reference(tmp_path, configuration | {"seed": 3})

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.errors import UserError
from nbv.experiment.report.tables import TABLES
from nbv.experiment.run.compare import (
    IDENTICAL,
    OUTSIDE,
    UNJUDGED,
    WITHIN,
    compare_runs,
    judge_cell,
    sigma_ratio,
)
from nbv.experiment.run.reference import UNSET, other_settings, read_cells
from synthetic import N_FOLDS


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
    judged = judge_cell(theirs, mine, 3.0)
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


def test_the_spread_of_rare_errors_is_not_judged_but_their_share_is(finished, run):
    """Few images decide it: it is 0 where no fold has such an error."""
    (cell,) = (
        cell
        for cell in read_cells(finished / "tables/table1.csv").values()
        if (cell["row"], cell["method"], cell["metric"]) == ("mug", "single", "above_90_percent")
    )
    judged = judge_cell(cell, cell | {"sigma": 5.0 * cell["sigma"] + 1.0}, 3.1)
    assert [row["quantity"] for row in judged if row["status"] == OUTSIDE] == []
    high = cell["ci_high"] + 50.0
    moved = cell | {"value": high, "ci_low": high - 1.0, "ci_high": high + 1.0}
    assert next(row["status"] for row in judge_cell(cell, moved, 3.1)) == OUTSIDE


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
    assert "0 outside, 1 not judged" in comparison.summary_line()


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
        "table5, 3 (135–224°), Single, errors above 90°: missing",
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
    text = (finished / "configuration.yaml").read_text().replace(
        "epochs: 8", "epochs: 4"
    ) + "seed: 3\n"
    (run / "configuration.yaml").write_text(text)
    comparison = compare_runs(finished, run)
    assert not comparison.agrees
    assert comparison.problems == ()
    assert comparison.settings == (("estimator.epochs", 8, 4), ("seed", UNSET, 3))
    first = comparison.lines()[0]
    assert first == other_settings(finished, comparison.settings)
    assert first.endswith(": estimator.epochs=4 (reference: 8), seed=3 (reference: not set)")
    assert "cells identical" in comparison.lines()[1]


def test_names_paths_hardware_and_versions_are_only_mentioned(finished, run):
    text = (run / "configuration.yaml").read_text().replace("name: synthetic", "name: other")
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


@pytest.mark.parametrize("name", ["configuration.yaml", "claims.csv"])
def test_folders_that_are_no_runs_are_named(finished, run, name):
    (run / name).unlink()
    for pair in ((finished, run), (run, finished)):
        with pytest.raises(UserError, match=f"{name} does not exist"):
            compare_runs(*pair)


def test_a_broken_reference_is_named(finished, run):
    (run / "configuration.yaml").write_text("n_folds: 1\n")
    with pytest.raises(UserError, match="n_folds=1: input should be greater than or equal to 2"):
        compare_runs(run, finished)
    shutil.copy(finished / "configuration.yaml", run)
    (run / "tables" / "table1.csv").write_text("row,method\n")
    with pytest.raises(UserError, match=r"table1\.csv: no column 'table'"):
        compare_runs(run, finished)
    shutil.rmtree(run / "tables")
    with pytest.raises(UserError, match="holds no tables"):
        compare_runs(run, finished)

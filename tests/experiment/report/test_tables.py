"""Tables recomputed from the files with plain Python."""

import csv
import re
import statistics
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import synthetic
from nbv.errors import UserError
from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.published import NOTES, PUBLISHED
from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.table import table_html, table_latex, table_markdown
from nbv.experiment.report.tables import TABLES, build_table, claims_table
from table_readers import html_cells, pipe_rows

QUICK = ReportSettings(n_resamples=200)


@pytest.fixture(scope="module")
def rows(tree):
    """Every row of every file, read by the csv module alone."""
    found = []
    for path in sorted((tree / "evaluation").rglob("*.csv")):
        category, elevation, fold = path.parts[-4], int(path.parts[-3][2:]), int(path.parts[-2][4:])
        with path.open() as stream:
            for row in csv.DictReader(stream):
                found.append(
                    {
                        "category": category,
                        "elevation": elevation,
                        "fold": fold,
                        "method": path.stem,
                        "object": row["object_id"],
                        "initial": int(row["initial_deg"]),
                        "error": float(row["error_deg"]),
                    }
                )
    return found


def errors_of(rows, method, **wanted):
    return [
        row["error"]
        for row in rows
        if row["method"] == method and all(row[key] == value for key, value in wanted.items())
    ]


def pauc(errors):
    return 100 - statistics.mean(min(error, 100.0) for error in errors)


def cell(table, row, method, metric):
    found = table.cells.query("row == @row and method == @method and metric == @metric")
    assert len(found) == 1
    return found.iloc[0]


def above_90(errors):
    return 100 * statistics.mean(error > 90 for error in errors)


@pytest.mark.parametrize(
    ("name", "metric", "function"),
    [
        ("table1", "mae", statistics.mean),
        ("table3", "pauc", pauc),
        ("table1", "above_90_percent", above_90),
    ],
)
def test_by_category(evaluations, rows, name, metric, function):
    table = build_table(name, evaluations, QUICK)
    assert set(table.cells["row"]) == {"mug", "chair"}
    for category in ("mug", "chair"):
        for method in synthetic.METHODS:
            found = cell(table, category, method, metric)
            where = {"category": category, "elevation": 0}
            assert found["value"] == pytest.approx(function(errors_of(rows, method, **where)))
            by_fold = [function(errors_of(rows, method, fold=f, **where)) for f in (1, 2, 3)]
            assert found["sigma"] == pytest.approx(statistics.stdev(by_fold))
            assert found["ci_low"] <= found["value"] <= found["ci_high"]
            assert (found["n_objects"], found["n_images"]) == (9, 9 * 360)


@pytest.mark.parametrize(
    ("name", "metric", "function"), [("table2", "mae", statistics.mean), ("table4", "pauc", pauc)]
)
def test_by_elevation(evaluations, rows, name, metric, function):
    table = build_table(name, evaluations, QUICK)
    assert list(dict.fromkeys(table.cells["row"])) == ["0", "30"]
    for elevation in (0, 30):
        expected = function(errors_of(rows, "proposed", category="mug", elevation=elevation))
        assert cell(table, str(elevation), "proposed", metric)["value"] == pytest.approx(expected)


def test_by_group(evaluations, rows):
    table = build_table("table5", evaluations, QUICK)
    spans = {"1": [*range(315, 360), *range(45)], "2": range(45, 135)}
    spans |= {"3": range(135, 225), "4": range(225, 315)}
    for group, span in spans.items():
        for method in synthetic.METHODS:
            inside = set(span)
            expected = statistics.mean(
                row["error"]
                for row in rows
                if row["method"] == method
                and (row["category"], row["elevation"]) == ("mug", 0)
                and row["initial"] in inside
            )
            assert cell(table, group, method, "mae")["value"] == pytest.approx(expected)


def test_by_fold(evaluations, rows):
    table = build_table("table7", evaluations, QUICK)
    where = {"category": "mug", "elevation": 0}
    for metric, function in (("mae", statistics.mean), ("pauc", pauc)):
        values = [function(errors_of(rows, "random", fold=f, **where)) for f in (1, 2, 3)]
        found = [cell(table, str(f), "random", metric)["value"] for f in (1, 2, 3)]
        assert found == pytest.approx(values)
        average = cell(table, "average", "random", metric)
        assert average["value"] == pytest.approx(function(errors_of(rows, "random", **where)))
        assert cell(table, "sigma", "random", metric)["value"] == pytest.approx(
            statistics.stdev(values)
        )


def test_the_average_is_of_pooled_images_not_of_folds(evaluations):
    frame = evaluations["mug", 0]
    smaller = frame[(frame["fold"] != 1) | (frame["object_id"] == "0000")]
    table = build_table("table7", {("mug", 0): smaller}, QUICK)
    single = smaller.loc[smaller["method"] == "single", "error_deg"]
    assert cell(table, "average", "single", "mae")["value"] == pytest.approx(single.mean())
    folds = [cell(table, str(f), "single", "mae")["value"] for f in (1, 2, 3)]
    assert abs(single.mean() - np.mean(folds)) > 1e-3


def test_the_example_is_the_median_object_of_fold_2(evaluations, rows):
    where = {"category": "mug", "elevation": 0, "fold": 2}
    objects = sorted({row["object"] for row in rows if row["fold"] == 2})
    means = sorted(
        (statistics.mean(errors_of(rows, "single", object=name, **where)), name) for name in objects
    )
    chosen = means[(len(means) - 1) // 2][1]
    table = build_table("table6", evaluations, QUICK)
    assert f"Object {chosen} of fold 2" in table.notes[0]
    for azimuth in (0, 30, 210, 330):
        expected = errors_of(rows, "proposed", object=chosen, initial=azimuth, **where)
        assert [cell(table, str(azimuth), "proposed", "error")["value"]] == expected


def test_published_figures_are_shown_for_the_same_category_and_elevation_only(evaluations):
    table = build_table("table1", evaluations, QUICK)
    assert cell(table, "mug", "opposite", "mae")["published"] == 11.03
    assert cell(table, "chair", "single", "mae")["published"] == 10.88
    raised = build_table("table1", {("mug", 30): evaluations["mug", 30]}, QUICK)
    assert raised.cells["published"].isna().all()
    other = build_table("table2", {("chair", 0): evaluations["chair", 0]}, QUICK)
    assert other.cells["published"].isna().all()


def test_every_category_has_a_row(evaluations):
    units = {("mug", 30): evaluations["mug", 30], ("chair", 0): evaluations["chair", 0]}
    for name in ("table1", "table3"):
        table = build_table(name, units, QUICK)
        labels = table.cells.drop_duplicates("row").set_index("row")["row_label"]
        assert labels.to_dict() == {"mug": "Mug (30°)", "chair": "Chair"}
        assert table.heading.endswith("by category at elevation 0°")
        assert table.heading == f"Table {name[-1]}: {table.caption}"
        shown = table.cells.groupby("row")["published"].agg(lambda printed: printed.notna().any())
        assert shown.to_dict() == {"mug": False, "chair": True}


@pytest.mark.parametrize("name", TABLES)
def test_notes_are_about_what_is_shown(evaluations, name):
    mug = build_table(name, evaluations, QUICK).notes
    assert {note.text for note in NOTES if name in note.tables} <= set(mug)
    chair = {("chair", 0): evaluations["chair", 0]}
    notes = " ".join(build_table(name, chair, QUICK).notes)
    assert "Mug" not in notes
    if name not in ("table1", "table3"):
        assert "ublished" not in notes
    elif name == "table3":
        assert "published pAUC" in notes
    frame = evaluations["mug", 0]
    alone = {("mug", 0): frame[frame["method"].isin(["single", "proposed"])]}
    assert "Opposite is the paired" not in " ".join(build_table(name, alone, QUICK).notes)
    assert "Opposite takes" not in " ".join(build_table(name, alone, QUICK).notes)


def test_the_difference_is_to_the_reference_and_has_the_sign_of_the_values(evaluations):
    table = build_table("table1", evaluations, QUICK)
    found = cell(table, "mug", "single", "mae")
    opposite = cell(table, "mug", "opposite", "mae")
    assert found["difference"] == pytest.approx(found["value"] - opposite["value"])
    assert found["difference_low"] <= found["difference"] <= found["difference_high"]
    assert np.isnan(opposite["difference"])


@pytest.mark.parametrize("name", TABLES)
def test_tables_work_with_what_is_present(evaluations, name):
    frame = evaluations["chair", 0]
    two = frame[frame["method"].isin(["single", "proposed"]) & (frame["fold"] == 3)]
    table = build_table(name, {("chair", 0): two}, replace(QUICK, focus_category="chair"))
    assert set(table.cells["method"]) == {"single", "proposed"}
    assert table.cells["value"].notna().all() or name == "table7"


def test_further_methods_become_columns(evaluations):
    frame = evaluations["mug", 0].astype({"method": str})
    extra = frame[frame["method"] == "proposed"].assign(method="expected_error")
    joined = {("mug", 0): pd.concat([frame, extra], ignore_index=True)}
    settings = replace(QUICK, methods=(*synthetic.METHODS, "expected_error"))
    table = build_table("table1", joined, settings)
    assert cell(table, "mug", "expected_error", "mae")["value"] == pytest.approx(
        cell(table, "mug", "proposed", "mae")["value"]
    )


def test_every_published_table_can_be_built():
    assert set(TABLES) == set(PUBLISHED)


def test_mistakes_are_named(evaluations):
    with pytest.raises(UserError, match="no table 'tabel1'; did you mean 'table1'"):
        build_table("tabel1", evaluations)
    with pytest.raises(UserError, match="focus_category 'mugg' was not evaluated; did you mean"):
        build_table("table2", evaluations, ReportSettings(focus_category="mugg"))
    with pytest.raises(UserError, match="no evaluated category"):
        build_table("table1", {})


@pytest.fixture
def claims(evaluations, rng):
    return evaluate_claims(evaluations, rng, 100)


def test_every_claim_has_one_row_and_those_not_run_come_last(claims):
    run, absent = claims_table(claims).parts
    assert len(run.rows) + len(absent.rows) == len(CLAIMS)
    verdicts = [[row[3].text for row in part.rows] for part in (run, absent)]
    assert "not run" not in verdicts[0]
    assert set(verdicts[1]) == {"not run"}
    pd.testing.assert_frame_equal(claims_table(claims).cells, claims)


def test_every_format_shows_every_claim(claims):
    table = claims_table(claims)
    rows = pipe_rows(table_markdown(table))
    assert len(rows) == 2 + len(CLAIMS)  # each part repeats the header
    assert {len(row) for row in rows} == {len(table.header)}
    shown = html_cells(table_html(table))
    for row in rows:
        assert all(text in shown for text in row)
    latex = table_latex(table)
    assert latex.isascii()
    assert not any("nan" in text for text in shown)


def test_without_results_no_claim_was_run(rng):
    (part,) = claims_table(evaluate_claims({}, rng, 10)).parts
    assert part.heading == "Not run"
    assert len(part.rows) == len(CLAIMS)


@pytest.fixture(scope="module")
def tables(evaluations):
    return {name: build_table(name, evaluations, QUICK) for name in TABLES}


@pytest.mark.parametrize("name", TABLES)
def test_every_format_shows_the_same_rows(tables, name):
    markdown, latex = table_markdown(tables[name]), table_latex(tables[name])
    rows = pipe_rows(markdown)
    assert html_cells(table_html(tables[name])) == [cell for row in rows for cell in row]
    body = latex.split("\\midrule\n")[1].split("\\bottomrule")[0].strip().splitlines()
    assert len(body) == len(rows) - 1
    assert all(line.count(" & ") == len(rows[0]) - 1 and line.endswith("\\\\") for line in body)
    assert markdown.count("**") // 2 == latex.count("\\textbf{")


@pytest.mark.parametrize("name", TABLES)
def test_latex_is_balanced_and_plain(tables, name):
    latex = table_latex(tables[name])
    assert latex.isascii()
    assert latex.count("{") - latex.count("\\{") == latex.count("}") - latex.count("\\}")
    for environment in ("table", "tabular"):
        assert latex.count(f"\\begin{{{environment}}}") == 1
        assert latex.count(f"\\end{{{environment}}}") == 1
    assert re.search(r"\\begin\{tabular\}\{lr+\}", latex)
    assert latex.count("\\toprule") == latex.count("\\midrule") == latex.count("\\bottomrule") == 1


def test_the_best_is_the_lowest_error_and_the_highest_pauc(tables):
    for name, best in (("table2", min), ("table4", max)):
        for row in pipe_rows(table_markdown(tables[name]))[1:]:
            values = [float(re.search(r"[\d.]+", cell)[0]) for cell in row[1:5]]
            bold = [value for value, cell in zip(values, row[1:5], strict=True) if "**" in cell]
            assert set(bold) == {(min if row[0].endswith("above 90°") else best)(values)}


def test_the_least_spread_over_folds_is_the_best(tables):
    (sigma,) = (row for row in tables["table7"].rows if row[0].text == "σ")
    for offset in (1, 2):
        values = [float(cell.text.rstrip("°")) for cell in sigma[offset::2]]
        bold = [float(cell.text.rstrip("°")) for cell in sigma[offset::2] if cell.bold]
        assert set(bold) == {min(values)}


def test_the_share_of_errors_above_90_degrees_stands_below_the_figures(tables):
    for name in ("table1", "table2", "table3", "table4", "table5"):
        labels = [row[0].text for row in tables[name].rows]
        shares = tables[name].cells.query("metric == 'above_90_percent'")
        largest = shares.groupby("row_label", sort=False)["value"].max()
        assert labels[: len(largest)] == list(largest.index)
        above = [f"{label}: errors above 90°" for label in largest[largest > 0].index]
        assert labels[len(largest) :] == above


@pytest.mark.parametrize("units", [("chair",), ("chair", "mug")])
def test_rows_without_an_error_above_90_degrees_are_one_note(evaluations, units):
    few = {(name, 0): evaluations[name, 0] for name in units}
    few["chair", 0] = few["chair", 0].assign(error_deg=few["chair", 0]["error_deg"].clip(upper=90))
    table = build_table("table1", few, QUICK)
    above = [row[0].text for row in table.rows if "above" in row[0].text]
    assert above == [f"{name.title()}: errors above 90°" for name in units if name != "chair"]
    (note,) = (note for note in table.notes if "above 90°" in note)
    assert ("Chair" in note) == (len(units) > 1)
    assert "Mug" not in note


@pytest.mark.parametrize("name", TABLES)
def test_the_column_in_sight_is_that_of_proposed(tables, name, evaluations):
    table = tables[name]
    assert table.header[table.in_sight].startswith("Proposed")
    first_row = html_cells(table_html(table))[: len(table.header)]
    assert re.findall('<th scope="col" class="in-sight">([^<]+)<', table_html(table)) == [
        first_row[table.in_sight]
    ]
    frame = evaluations["mug", 0]
    other = {("mug", 0): frame[frame["method"] != "proposed"]}
    assert build_table(name, other, QUICK).in_sight is None


def test_published_figures_are_in_brackets_and_never_bold(tables):
    markdown = table_markdown(tables["table1"])
    assert "[11.03°]" in markdown
    assert not re.search(r"\*\*[^*|]*\[[^*|]*\*\*", markdown)
    assert re.search(r"\*\*[\d.]+°\*\* \[", markdown)


def test_the_last_column_is_the_difference_that_the_cells_have(tables):
    table = tables["table1"]
    assert table.header[-1] == "Proposed − Opposite"
    cells = table.cells[table.cells["method"] == "proposed"]
    for row in table.rows:
        label, *above_90 = row[0].text.split(": ")
        shown = cells[(cells["metric"] == "mae") != bool(above_90)]
        found = shown[shown["row_label"] == label].iloc[0]
        value, low, high = (
            float(text.replace("−", "-")) for text in re.findall(r"[−\d.]+", row[-1].text)
        )
        assert (value, low, high) == pytest.approx(
            (found["difference"], found["difference_low"], found["difference_high"]), abs=0.005
        )


def test_table_6_pairs_ours_with_the_published_example(tables):
    labels = [row[0].text for row in tables["table6"].rows]
    assert labels[:2] == ["0°", "0°, published"]
    assert "342.0° (18.0°)" in [cell.text for cell in tables["table6"].rows[1]]


def test_an_estimate_that_rounds_to_360_degrees_is_zero(evaluations):
    frame = evaluations["mug", 0].copy()
    first = (frame["initial_deg"] == 0) & (frame["method"] == "single")
    frame.loc[first, ["pose_estimate_deg", "error_deg"]] = (359.96, 0.04)
    table = build_table("table6", {("mug", 0): frame}, QUICK)
    texts = [cell.text for cell in table.rows[0]]
    assert "0.0° (0.0°)" in texts
    assert not any("360.0°" in text for text in texts)

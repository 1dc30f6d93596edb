"""Tables and the figure over all trainings."""

from __future__ import annotations

import pandas as pd
import pytest
from studies.confirmation import (
    BELIEF_COLUMNS,
    TRAININGS_COLUMNS,
    belief_means,
    method_contrasts,
    method_means,
    training_contrasts,
)
from studies.confirmation_tables import (
    answers_figure,
    beliefs_table,
    contrasts_figure,
    contrasts_table,
    densities_table,
    methods_table,
)
from studies.factorial import DENSITY_COLUMNS

from nbv.experiment.report.table import table_markdown
from nbv.labels import interval_text
from tests.studies.test_confirmation_table import SHIFT, objects_frame

NO_TRAININGS = pd.DataFrame(columns=list(TRAININGS_COLUMNS))


@pytest.fixture(scope="module")
def contrasts():
    return method_contrasts(objects_frame())


def test_a_column_for_each_fusion_and_a_row_for_each_choice():
    means = method_means(objects_frame())
    table = methods_table(means)
    assert table.header == ("Choice", "Average", "Product")
    assert [part.heading for part in table.parts] == ["real, Mug", "real, Car", "real, All"]
    of_mug = {row[0].text: [cell.text for cell in row[1:]] for row in table.parts[0].rows}
    assert len(of_mug) == len({(choice, n) for choice, _, n in SHIFT})
    assert of_mug["One view"][0] == of_mug["One view"][1]
    assert of_mug["Random"][1] == "–"
    mean = means[(means["category"] == "mug") & (means["choice"] == "random")].iloc[0]
    low, high = f"{mean['low']:.2f}", f"{mean['high']:.2f}"
    assert of_mug["Random"][0] == f"{mean['mae_deg']:.2f} ({low} to {high})"
    assert "Evenly spaced, 3 views" in of_mug


def test_a_difference_is_marked_where_its_interval_excludes_0(contrasts):
    table = contrasts_table(contrasts, NO_TRAININGS)
    assert table.parts[0].heading == "real, Mug (8 objects, 3 trainings)"
    rows = [row for part in table.parts for row in part.rows]
    assert len(rows) == len(contrasts)
    for row, (_, found) in zip(rows, contrasts.iterrows(), strict=True):
        assert (row[2].after == "*") == (found["low"] > 0 or found["high"] < 0)
        assert not any(cell.bold for cell in row)
    assert "| Expected error less fixed | average |" in table_markdown(table)


def test_a_note_says_how_well_single_trainings_agree(contrasts):
    of_trainings = training_contrasts(objects_frame())
    note = contrasts_table(contrasts, of_trainings).notes[-1]
    predicted = overall = 0
    for _, row in of_trainings.iterrows():
        same = (
            contrasts[["category", "contrast", "fusion"]]
            == row[["category", "contrast", "fusion"]].tolist()
        )
        (found,) = (one for _, one in contrasts[same.all(axis=1)].iterrows())
        predicted += row["low"] <= row["difference_deg"] <= row["high"]
        overall += found["low"] <= row["difference_deg"] <= found["high"]
    n = len(of_trainings)
    assert f"of {n} differences, {100 * predicted / n:.0f} %" in note
    assert f"and {100 * overall / n:.0f} % in the intervals above" in note
    assert len(contrasts_table(contrasts, NO_TRAININGS).notes) == 3


def test_beliefs_have_a_row_for_each_choice_fusion_and_number_of_views():
    figures = ["error_deg", "pauc_percent", "above_90_percent"]
    means = belief_means(
        objects_frame().rename(columns=dict(zip(figures, BELIEF_COLUMNS, strict=True)))
    )
    table = beliefs_table(means)
    assert sum(len(part.rows) for part in table.parts) == len(means)
    first, found = table.parts[0].rows[0], means.iloc[0]
    assert [cell.text for cell in first[:2]] == ["One view", "none"]
    assert first[2].text.startswith(f"{found['log_likelihood']:.2f} (")
    assert [float(cell.text) for cell in first[3:]] == pytest.approx(
        [found["inside_50_percent"], found["inside_90_percent"]], abs=0.05
    )


def test_densities_are_counted_over_folds_and_trainings():
    rows = [
        ("real", "mug", 0, replicate, fold, *pair, width, alpha, 100 * 20 / (20 + alpha), 5.0)
        for replicate in (0, 1)
        for fold in (1, 2)
        for pair, width, alpha in (
            (("random", "posterior"), 4.0 * fold, 100.0),
            (("through_estimate", "average"), 6.0, 0.0),
        )
    ]
    places = ["dataset", "category", "shuffle", "replicate", "fold"]
    table = densities_table(pd.DataFrame(rows, columns=[*places, *DENSITY_COLUMNS]))
    assert table.parts[0].heading == "real, Mug (4 folds)"
    assert [[cell.text for cell in row] for row in table.parts[0].rows] == [
        ["Random", "posterior", "4° (2), 8° (2)", "100 (4)", "17"],
        ["Through estimate", "average", "6° (4)", "0 (4)", "100"],
    ]


def test_a_panel_for_each_question_and_data_set_and_a_mark_for_each_answer(contrasts):
    """A data set that does not answer a question leaves no empty panel."""
    other = contrasts[contrasts["fusion"] == "product"].assign(dataset="embedded")
    both = pd.concat([contrasts, other], ignore_index=True)
    figure = contrasts_figure(both)
    answers = both[both["question"] > 0].sort_values(["question", "fusion"], kind="stable")
    panels = {
        (row, dataset): own
        for row, (_, part) in enumerate(answers.groupby(["contrast", "fusion"], sort=False))
        for dataset, own in part.groupby("dataset", sort=False)
    }
    assert len(figure.axes) == len(panels)
    first_in_row = set()
    for axes, ((row, dataset), part) in zip(figure.axes, panels.items(), strict=True):
        title = axes.get_title(loc="left")
        assert dataset in title
        if row not in first_in_row:
            assert title.startswith(f"{part['question'].iloc[0]}. ")
        first_in_row.add(row)
        labels = [label.get_text() for label in axes.get_yticklabels()]
        assert labels == [category.capitalize() for category in part["category"]]
        marks = [line for line in axes.lines if line.get_marker() not in ("None", "")]
        assert [mark.get_xdata()[0] for mark in marks] == part["difference_deg"].tolist()
        for mark, (_, row) in zip(marks, part.iterrows(), strict=True):
            expected = "X" if row["low"] > 0 else "o" if row["high"] < 0 else "s"
            assert mark.get_marker() == expected
    assert "Difference of MAE (degrees)" in figure.axes[-1].get_xlabel()


def test_answers_are_over_all_categories_with_their_numbers(contrasts):
    """A data set of one category has no others to be pooled with."""
    lone = contrasts[contrasts["category"] == "mug"].assign(dataset="embedded")
    figure = answers_figure(pd.concat([contrasts, lone], ignore_index=True))
    (axes,) = figure.axes
    pooled = pd.concat([contrasts[contrasts["category"] == "all"], lone])
    pooled = pooled[pooled["question"] > 0].sort_values(["question", "fusion"], kind="stable")
    assert len(pooled) == 4
    texts = [
        interval_text(row["difference_deg"], row["low"], row["high"])
        for _, of_question in pooled.groupby(["question", "contrast", "fusion"], sort=False)
        for _, row in of_question.iterrows()
    ]
    assert [text.get_text() for text in axes.texts] == texts
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert [label for label in labels if label in ("real", "embedded")] == ["real", "embedded"] * 2
    assert [label[0] for label in labels if label[0].isdigit()] == ["1", "4"]


@pytest.mark.parametrize("drawn", [answers_figure, contrasts_figure])
def test_without_an_answer_there_is_no_figure(contrasts, drawn):
    none = pd.DataFrame(columns=contrasts.columns).astype({"question": int})
    with pytest.raises(ValueError, match="no contrast answers a question"):
        drawn(none)

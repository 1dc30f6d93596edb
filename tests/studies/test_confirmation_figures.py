"""The figures over all trainings."""

import pandas as pd
import pytest
from studies.confirmation import method_contrasts
from studies.confirmation_figures import answers_figure, contrasts_figure
from tests.studies.test_confirmation import objects_frame

from nbv.labels import interval_text


@pytest.fixture(scope="module")
def contrasts():
    return method_contrasts(objects_frame())


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

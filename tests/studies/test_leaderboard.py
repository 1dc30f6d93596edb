import numpy as np
import pandas as pd
import pytest
from scipy import stats
from studies.leaderboard import blocks_of, leaderboard_table

from method_errors import METHODS, SHIFTS, blocks, object_rows, texts, without
from nbv.experiment.statistics.paired import Resampler


def board(shifts=SHIFTS, methods=METHODS, **rest):
    return leaderboard_table(blocks(shifts, **rest), methods, Resampler(0, 500))


def test_methods_come_by_mean_rank_and_bounds_last():
    table = board()
    expected = sorted(without(SHIFTS, "oracle_posterior"), key=SHIFTS.__getitem__)
    names = [name.replace(" ", "_") for name in texts(table)]
    assert names == [*expected, "oracle_posterior"]
    assert table.header == ("Method", "Mug (run)", "Car (run)", "Chair (run)", "Mean rank")
    ranks = [row[-1] for row in texts(table).values()]
    assert ranks == [f"{rank:.2f}" for rank in range(1, 9)] + ["–"]


def test_a_method_of_two_names_is_ranked_once():
    twin = METHODS | {"opposite_average": {"policy": "opposite", "fusion": "average"}}
    shifts = SHIFTS | {"opposite_average": SHIFTS["opposite"]}
    both, once = board(shifts, twin), board()
    assert texts(both).keys() == texts(once).keys()
    assert {name: row[-1] for name, row in texts(both).items()} == {
        name: row[-1] for name, row in texts(once).items()
    }


def test_cells_are_maes_and_paired_differences_to_the_opposite_view():
    rows = object_rows()
    table = board()
    mean = rows.groupby(["category", "method"])["error_deg"].mean()
    assert len(table.cells) == len(mean)
    for cell in table.cells.to_dict("records"):
        category, method = cell["category"], cell["method"]
        assert cell["value"] == pytest.approx(mean[category, method])
        assert cell["ci_low"] < cell["value"] < cell["ci_high"]
        assert cell["versus"] == ("proposed" if method == "opposite" else "opposite")
        gap = mean[category, method] - mean[category, cell["versus"]]
        assert cell["difference"] == pytest.approx(gap)


def test_the_lowest_is_bold_and_what_is_above_it_for_certain_is_marked():
    clear = {"opposite": 3.0, "proposed": 3.0, "selected": 0.0}
    close = {"opposite": 0.05, "proposed": 0.05, "selected": 0.0}
    table = leaderboard_table(
        blocks(clear, categories=["a"], noise=0.5) | blocks(close, categories=["b"], noise=0.5),
        METHODS,
        Resampler(0, 500),
    )
    for column in (1, 2):
        ranked = [row[column] for row in table.rows if "oracle" not in row[0].text]
        lowest = min(ranked, key=lambda cell: float(cell.text))
        assert [cell for cell in ranked if cell.bold] == [lowest]
    marks = {row[0].text: [cell.after for cell in row[1:3]] for row in table.rows}
    assert marks["selected"] == ["", ""]
    assert marks["opposite"] == ["*", ""]
    best = table.cells.set_index(["category", "method"])["among_best"]
    assert not best["a", "opposite"]
    assert best["b", "opposite"]


def test_friedmans_test_ranks_each_method_once():
    """Ranks of the fair methods; an oracle is one by its policy, whatever its name."""
    methods = without(METHODS, "oracle_posterior") | {"bound": METHODS["oracle_posterior"]}
    shifts = without(SHIFTS, "oracle_posterior") | {"bound": -5.0}
    table = board(shifts, methods)
    n = len(methods) - 1
    pvalue = stats.friedmanchisquare(*np.tile(np.arange(n), (3, 1)).T).pvalue
    assert f"p = {pvalue:.2g}." in table.notes[2]
    assert texts(table)["bound"][-1] == "–"


def test_a_fair_method_may_have_any_name():
    name = "oracle_like_chosen_selected"
    table = board(SHIFTS | {name: 1.5}, METHODS | {name: {"policy": "expected_error"}})
    assert texts(table)[name.replace("_", " ")][-1] == "3.00"


def test_the_selected_pair_is_compared_wherever_it_is_there():
    assert sum("Wilcoxon" in note for note in board().notes) == 2
    renamed = {{"selected": "mine"}.get(name, name): method for name, method in METHODS.items()}
    shifts = without(SHIFTS, "selected") | {"mine": 0.0}
    assert "columns, mine against opposite selected" in board(shifts, renamed).notes[3]


def test_without_the_selected_pair_its_notes_are_left_out():
    few = without(METHODS, "selected", "opposite_selected")
    notes = board(without(SHIFTS, "selected", "opposite_selected"), few).notes
    assert not any("Wilcoxon" in note for note in notes)
    assert any("Friedman" in note for note in notes)


def test_only_what_every_block_and_the_configuration_have_is_shown():
    runs = {"a": object_rows(), "b": object_rows(without(SHIFTS, "fixed_average"))}
    shown = texts(leaderboard_table(blocks_of(runs), METHODS, Resampler(0, 100)))
    assert "fixed average" not in shown
    assert "single" in shown
    assert "single" not in texts(board(methods=without(METHODS, "single")))


def test_a_category_without_the_reference_elevation_is_shown_at_its_lowest():
    rows = object_rows(categories=["mug"])
    high = rows.assign(elevation_deg=30, error_deg=rows["error_deg"] + 1)
    higher = rows.assign(elevation_deg=60)
    found = blocks_of({"run": pd.concat([higher, high])})["run", "mug"]
    mean = high[high["method"] == "single"]["error_deg"].mean()
    assert found.errors_deg["single"].mean() == pytest.approx(mean)

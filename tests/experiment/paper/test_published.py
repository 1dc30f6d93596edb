"""The notes on the paper, recomputed from its own figures."""

import math
import statistics

import pytest

from nbv.experiment.paper.published import (
    AVERAGE_ROW,
    METHODS,
    NOTES,
    PUBLISHED,
    SIGMA_ROW,
    published_value,
)


def folds(metric):
    rows = PUBLISHED["table7"][metric]
    return list(zip(*(rows[fold] for fold in "12345"), strict=True))


def test_mug_rows_of_tables_1_and_3_are_fold_2():
    for table, metric in (("table1", "mae"), ("table3", "pauc")):
        assert PUBLISHED[table][metric]["mug"] == PUBLISHED["table7"][metric]["2"]


def test_tables_2_and_4_print_the_five_fold_averages_for_the_mug():
    sevenths = PUBLISHED["table7"]
    assert PUBLISHED["table2"]["mae"]["0"] == sevenths["mae"][AVERAGE_ROW]
    assert PUBLISHED["table4"]["pauc"]["0"][1:] == sevenths["pauc"][AVERAGE_ROW][1:]


def test_averages_follow_from_the_folds_but_for_one_slip():
    for metric in ("mae", "pauc"):
        printed = PUBLISHED["table7"][metric][AVERAGE_ROW]
        wrong = [
            method
            for method, column, value in zip(METHODS, folds(metric), printed, strict=True)
            if abs(statistics.mean(column) - value) > 0.0061
        ]
        assert wrong == (["single"] if metric == "pauc" else [])
    assert statistics.mean(folds("pauc")[0]) == pytest.approx(87.73, abs=0.005)
    assert published_value("table4", "pauc", "0", "single") == 87.73


def test_sigma_is_the_sample_standard_deviation():
    for metric in ("mae", "pauc"):
        printed = PUBLISHED["table7"][metric][SIGMA_ROW]
        for column, value in zip(folds(metric), printed, strict=True):
            assert statistics.stdev(column) == pytest.approx(value, abs=0.0075)
            assert abs(statistics.pstdev(column) - value) > 0.2


def test_table_5_averages_to_fold_3():
    groups = zip(*PUBLISHED["table5"]["mae"].values(), strict=True)
    for column, fold in zip(groups, PUBLISHED["table7"]["mae"]["3"], strict=True):
        assert statistics.mean(column) == pytest.approx(fold, abs=0.0061)


def test_table_6_errors_follow_from_its_estimates_but_for_one_slip():
    wrong = []
    for azimuth, estimates in PUBLISHED["table6"]["estimate"].items():
        for method, estimate in zip(METHODS, estimates, strict=True):
            difference = abs(estimate - float(azimuth)) % 360
            printed = published_value("table6", "error", azimuth, method)
            if min(difference, 360 - difference) != pytest.approx(printed):
                wrong.append((azimuth, method))
    assert wrong == [("0", "random")]


def test_the_published_pauc_cannot_be_the_exact_integral_everywhere():
    # 100 - MAE is the least that an exact pAUC can be: no error counts for more than itself.
    below = {
        (table, row, method): round(100 - mae - published_value(table, "pauc", row, method), 2)
        for table, of_mae in (("table3", "table1"), ("table4", "table2"))
        for row, values in PUBLISHED[of_mae]["mae"].items()
        for method, mae in zip(METHODS, values, strict=True)
    }
    lower = [amount for amount in below.values() if amount > 0]
    assert (len(below), len(lower), max(lower)) == (44, 32, 0.53)
    assert sum(0.45 < amount < 0.55 for amount in lower) == 10
    # All but one of them by more than rounding MAE and pAUC to two decimals can do.
    assert sum(amount > 0.011 for amount in lower) == 31
    for table in ("table3", "table4", "table7"):
        (note,) = (note.text for note in NOTES if table in note.tables and "integral" in note.text)
        assert "in 32 of the 44 cells of Tables 3 and 4, by 0.53 at most" in note


def test_what_the_paper_does_not_print_is_none():
    for place in (("mae", "bicycle", "single"), ("mae", "mug", "information_gain")):
        assert math.isnan(published_value("table1", *place))
    assert math.isnan(published_value("table1", "pauc", "mug", "single"))

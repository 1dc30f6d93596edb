from __future__ import annotations

import numpy as np
import pytest
from studies.gains import extension_gains_table, favoured

from nbv.experiment.statistics.paired import Resampler

from .made import METHODS, SHIFTS, blocks, choices, object_rows, texts, without

ERRORS = {
    "opposite_posterior": 7.0,
    "fixed_average": 6.0,
    "gain_posterior": 5.0,
    "selected": 1.0,
    "opposite_selected": 1.0,
    "oracle_posterior": 0.0,
}


def gains(errors=ERRORS, shifts=SHIFTS, methods=METHODS):
    found = {"run": choices(errors)}
    return extension_gains_table(blocks(shifts), found, methods, Resampler(0, 500))


def test_the_favoured_extension_has_the_least_validated_error_over_categories():
    rows = choices({"fixed_average": 6.0, "gain_posterior": 7.0})
    mug = rows["category"] == "mug"
    rows.loc[mug & (rows["method"] == "gain_posterior"), "validated_error_deg"] = 3.0
    assert favoured({"run": rows}, METHODS) == {"run": "gain_posterior"}
    rows.loc[~mug & (rows["method"] == "gain_posterior"), "validated_error_deg"] = 8.0
    assert favoured({"run": rows}, METHODS) == {"run": "fixed_average"}


def test_bounds_random_views_and_what_is_selected_are_not_favoured_whatever_their_names():
    methods = METHODS | {
        "chance": {"policy": "random", "fusion": "posterior"},
        "bound": {"policy": "oracle", "fusion": "average"},
        "follower": {"policy": "selected", "fusion": "posterior"},
        "hand_chosen": {"policy": "expected_error", "fusion": "posterior"},
    }
    errors = ERRORS | {"chance": 0.0, "bound": 0.0, "follower": 0.0, "hand_chosen": 4.0}
    assert favoured({"run": choices(errors)}, methods) == {"run": "hand_chosen"}


def test_what_was_not_cross_validated_is_not_favoured():
    methods = METHODS | {"gain_product": {"policy": "information_gain", "fusion": "product"}}
    errors = ERRORS | {"gain_product": np.nan}
    assert favoured({"run": choices(errors)}, methods) == {"run": "gain_posterior"}
    assert favoured({"run": choices(dict.fromkeys(ERRORS, np.nan))}, METHODS) == {}


def test_gains_are_paired_differences_to_opposite_with_the_same_fusion_and_to_proposed():
    table = gains()
    mean = object_rows().groupby(["category", "method"])["error_deg"].mean()
    differences = table.cells.dropna(subset="difference")
    pairs = list(zip(differences["method"], differences["versus"], strict=True))[:4]
    assert pairs == [
        ("gain_posterior", "opposite_posterior"),
        ("gain_posterior", "proposed"),
        ("selected", "opposite_selected"),
        ("selected", "proposed"),
    ]
    for cell in differences.to_dict("records"):
        of = mean[cell["category"]]
        assert cell["difference"] == pytest.approx(of[cell["method"]] - of[cell["versus"]])
    assert all(cell.after == "*" for row in table.rows for cell in row[-4:])
    assert texts(table)["Mug (run)"][:6] == [
        f"{mean['mug', name]:.2f}"
        for name in (
            *("opposite", "proposed", "opposite_posterior"),
            *("gain_posterior", "selected", "oracle_posterior"),
        )
    ]
    assert table.header[-2:] == ("By fold − Opposite, same fusion", "By fold − Proposed")
    assert "(run: gain posterior)" in table.notes[0]


def test_with_average_fusion_opposite_is_the_papers_method():
    table = gains(ERRORS | {"fixed_average": 1.0})
    row = dict(zip(table.header[1:], texts(table)["Mug (run)"], strict=True))
    assert row["Opposite, same fusion"] == row["Opposite"]
    versus = table.cells.dropna(subset="difference")["versus"]
    assert versus.iloc[0] == "opposite"


def test_without_the_selected_pair_its_columns_and_note_are_left_out():
    names = ("selected", "opposite_selected")
    table = gains(without(ERRORS, *names), without(SHIFTS, *names), without(METHODS, *names))
    assert not any("By fold" in text for text in (*table.header, *table.notes))
    assert "Favoured − Proposed" in table.header
    assert not set(names) & set(table.cells["method"])


def test_without_an_oracle_or_any_validation_their_columns_are_left_out():
    bare = without(METHODS, "oracle_posterior")
    table = gains(dict.fromkeys(ERRORS, np.nan), without(SHIFTS, "oracle_posterior"), bare)
    assert table.header == (
        *("Category", "Opposite", "Proposed", "By fold"),
        *("By fold − Opposite, same fusion", "By fold − Proposed"),
    )
    assert not any("Oracle" in note or "Favoured" in note for note in table.notes)

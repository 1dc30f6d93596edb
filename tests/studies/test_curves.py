from __future__ import annotations

import pandas as pd
import pytest
from studies.curves import (
    more_views_figure,
    more_views_table,
    travel_curves,
    travel_figure,
    travel_table,
)

from nbv.errors import UserError
from nbv.experiment.report.table import write_table
from nbv.experiment.statistics.paired import Resampler

from .made import texts

METHODS = ("either_way_average", "gain_posterior")


def cells_of(methods):
    rows = [("mug", method, views, 9.0 / views) for method in methods for views in (1, 2, 3)]
    return pd.DataFrame(rows, columns=["category", "method", "n_views", "value"])


def travelled():
    """Fixed travel for the baseline; travel costs and limits for the criterion."""
    rows = [("either_way_average", "fixed", t, t, 9 - t / 30) for t in (0, 90, 180)]
    rows += [("gain_posterior", "cost", p, 170 - 50 * p, 3 + p) for p in (0, 1, 2)]
    rows += [("gain_posterior", "limit", 90, 60, 50.0)]
    columns = ["method", "rule", "setting", "travel_deg", "error_deg"]
    return pd.DataFrame(rows, columns=columns).assign(n_images=7)


def rows_of(errors, n_objects=12):
    """Rows of `experiments.more_views`: each object errs by its number less or more."""
    return pd.DataFrame(
        [
            (method, n_views, f"{k:02d}", 1 + k % 2, error + k / 10, 60.0 * (n_views - 1))
            for (method, n_views), error in errors.items()
            for k in range(n_objects)
        ],
        columns=["method", "n_views", "object_id", "fold", "error_deg", "travel_deg"],
    )


ERRORS = {("random", n): 12.0 - n for n in (1, 2, 3, 4)} | {
    ("information_gain", n): 10.0 - n for n in (1, 2, 3, 4)
}


def test_error_and_travel_by_views_and_three_views_compared_with_four_at_random():
    table = more_views_table({"mug": rows_of(ERRORS)}, Resampler(0, 200))
    assert table.header == (
        *("Policy", "1 view", "2 views", "3 views", "4 views"),
        "3 views − Random's 4",
    )
    shift = 0.55  # of the mean object
    gain = texts(table)["Mug: Information gain"]
    assert gain == [*(f"{10 - n + shift:.2f}" for n in (1, 2, 3, 4)), "−1.00 (−1.00 to −1.00)"]
    assert [cell.after for cell in table.rows[1][1:5]] == ["[0°]", "[60°]", "[120°]", "[180°]"]
    assert texts(table)["Mug: Random"][-1] == "–"
    assert [row[-1].after for row in table.rows] == ["", "*"]
    cells = table.cells.set_index(["method", "n_views"])
    assert cells.loc[("information_gain", 3), "to_random_4"] == pytest.approx(-1.0)
    assert cells["to_random_4"].notna().sum() == 1
    assert cells.loc[("random", 4), "travel_deg"] == 180


def test_a_policy_that_takes_fewer_views_has_dashes():
    few = {key: error for key, error in ERRORS.items() if key[0] == "random" or key[1] < 3}
    table = more_views_table({"mug": rows_of(few)}, Resampler(0, 200))
    assert texts(table)["Mug: Information gain"][2:] == ["–", "–", "–"]
    assert "to_random_4" not in table.cells.columns


def test_a_curve_for_each_policy_by_number_of_views():
    figure = more_views_figure(cells_of(["random", "information_gain"]))
    (axes,) = figure.axes
    assert (axes.get_title(), axes.get_xlabel()) == ("Mug", "Number of views")
    assert axes.get_ylabel() == "MAE (degrees)"
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["Random", "Information gain"]
    for line in axes.lines:
        assert list(line.get_xdata()) == [1, 2, 3]
        assert list(line.get_ydata()) == [9.0, 4.5, 3.0]


def test_a_curve_for_each_travel_cost_and_none_for_limits():
    figure = travel_figure({"mug": travelled(), "car": travelled()}, METHODS)
    assert [axes.get_title() for axes in figure.axes if axes.get_visible()] == ["Mug", "Car"]
    fixed, costed = figure.axes[0].lines
    assert list(fixed.get_ydata()) == [9, 6, 3]
    assert list(costed.get_xdata()) == [70, 120, 170]
    assert list(costed.get_ydata()) == [5, 4, 3]
    assert figure.axes[0].get_xlabel() == "Mean travel (degrees)"


def test_folds_are_pooled_by_category(tmp_path):
    files = {}
    for fold, shift in ((1, 0.0), (2, 2.0)):
        rows = travelled().assign(error_deg=lambda f, shift=shift: f["error_deg"] + shift)
        for category in ("mug", "car"):
            files[category, fold] = tmp_path / f"{category}{fold}.csv"
            rows.to_csv(files[category, fold], index=False)
    curves = travel_curves(files)
    assert list(curves) == ["mug", "car"]
    pooled = curves["car"]
    assert list(pooled.columns) == list(travelled().columns)
    assert pooled["error_deg"].tolist() == [error + 1 for error in travelled()["error_deg"]]
    with pytest.raises(UserError, match=r"no\.csv does not exist"):
        travel_curves({("mug", 1): tmp_path / "no.csv"})


def test_the_travel_table_holds_every_point_to_six_decimals(tmp_path):
    rows = travelled().assign(setting=1 / 3)
    table = travel_table({"mug": rows, "car": rows})
    write_table(table, {"csv": tmp_path / "travel.csv"})
    read = pd.read_csv(tmp_path / "travel.csv")
    assert list(read.columns) == [*rows.columns, "category"]
    assert (read["category"] == "mug").sum() == len(rows)
    assert read["setting"].tolist() == pytest.approx([0.333333] * 14, abs=1e-12)


def test_curves_have_the_style_of_every_figure():
    """Wherever they are called from: the spines that the style takes away are gone."""
    axes = more_views_figure(cells_of(["random"])).axes[0]
    assert not axes.spines["top"].get_visible()
    assert not axes.spines["right"].get_visible()


def test_the_legend_of_a_single_panel_stays_inside_the_figure():
    names = ["random", "bisecting", "evenly_spaced", "information_gain", "expected_dispersion"]
    figure = more_views_figure(cells_of([*names, "bayes_error", "pose_ambiguity"]))
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0

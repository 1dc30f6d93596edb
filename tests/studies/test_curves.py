import numpy as np
import pandas as pd
import pytest
from studies.curve_tables import (
    more_views_figure,
    more_views_table,
    travel_curves,
    travel_figure,
    travel_table,
)
from studies.curves import more_views_rows, pooled_travel, travel_rows
from studies.extensions import choices_frame, stored_evidence
from studies.selection import select_methods

from made_estimates import EXTENSIONS, FEW_DENSITIES, objects
from method_errors import texts
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Posteriors
from nbv.core.circle.evidence import evidence_of_distributions
from nbv.core.circle.logits import log_likelihood
from nbv.core.circle.policies import HeldOutViews, two_views
from nbv.errors import UserError
from nbv.experiment.report.table import write_table
from nbv.experiment.statistics.paired import Resampler

SETTINGS = {"n_views": 4, "start_every_deg": 60, "min_separation_deg": 15}
WITH_THE_PAPERS = EXTENSIONS | {
    "ambiguity_posterior": {"policy": "pose_ambiguity", "fusion": "posterior"},
    "error_posterior": {"policy": "expected_error", "fusion": "posterior"},
}


@pytest.fixture(scope="module")
def rows():
    calibration = objects(6, 0)
    choices = choices_frame(select_methods(calibration, WITH_THE_PAPERS, FEW_DENSITIES))
    evidences = stored_evidence(calibration, choices, FEW_DENSITIES)
    return more_views_rows(objects(3, 2), evidences, SETTINGS, np.random.default_rng(0))


def test_every_view_is_where_it_says_and_counts_its_travel(rows):
    means = rows.groupby(["method", "n_views"])[["error_deg", "travel_deg"]].mean()
    assert means.loc[("bisecting", 4), "travel_deg"] == 180 + 90 + 180
    assert means.loc[("evenly_spaced", 4), "travel_deg"] == 270
    assert means.loc[("evenly_spaced", 3), "travel_deg"] == 240
    assert (means.xs(1, level="n_views")["travel_deg"] == 0).all()
    for method in ("random", "bisecting", "information_gain", "bayes_error"):
        assert means.loc[(method, 4), "error_deg"] < means.loc[(method, 1), "error_deg"]


def test_two_errors_have_two_names_and_the_pose_ambiguity_is_of_two_views_alone(rows):
    """The kernel regression of real errors knows nothing of more views than two."""
    assert set(rows["method"]) == {
        "random",
        "bisecting",
        "evenly_spaced",
        "information_gain",
        "bayes_error",
    }


N_CLASSES = 36
AFFINITY = {"affinity": {"power": 8, "pseudo_observations": 90}}


def half_turned(n_objects, seed):
    """Distributions with two peaks half a turn apart, but for a quarter that knows the truth."""
    rng = np.random.default_rng(seed)
    truth, centres = np.arange(360.0), np.arange(N_CLASSES) * 360 / N_CLASSES
    answer = truth + rng.normal(0, 4, (n_objects, 360))
    peak = np.exp(20 * (np.cos(np.radians(centres - answer[..., None])) - 1))
    other = np.roll(peak, N_CLASSES // 2, axis=-1)
    blind = (circular_distance_deg(truth, 90) > 45)[:, None]
    p = np.where(blind, peak + rng.uniform(0.5, 2, (n_objects, 360, 1)) * other, peak) + 1e-6
    return Posteriors(
        tuple(f"{seed}-{k}" for k in range(n_objects)),
        np.log(p / p.sum(axis=-1, keepdims=True)),
        1.0,
    )


@pytest.fixture(scope="module")
def products():
    calibration, test = half_turned(8, 0), half_turned(4, 2)
    choices = choices_frame(select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES))
    evidences = stored_evidence(objects(6, 0), choices, FEW_DENSITIES)
    evidence = evidence_of_distributions(calibration.distributions, AFFINITY)
    estimates = objects(4, 2)
    rng = np.random.default_rng(0)
    return more_views_rows(estimates, evidences, SETTINGS, rng, test, evidence)


def test_one_view_knows_the_pose_as_well_as_its_distribution(products):
    test = half_turned(4, 2)
    starts = np.arange(0, 360, SETTINGS["start_every_deg"])
    logs = log_likelihood(np.log(test.distributions[:, starts]), starts[None, :])
    rows = products[(products["method"] == "random_product") & (products["n_views"] == 1)]
    np.testing.assert_allclose(rows["log_likelihood"], logs.mean(axis=1), atol=1e-4)
    for level in (50, 90):
        assert rows[f"inside_{level}_percent"].between(0, 100).all()


def test_with_distributions_the_same_policies_fuse_by_product(products):
    means = products.groupby(["method", "n_views"])["error_deg"].mean()
    for n_views in (2, 3, 4):
        assert means["information_gain_product", n_views] < 0.7 * means["random_product", n_views]
    assert means["evenly_spaced_product", 3] < 0.1 * means["evenly_spaced_product", 2]


def test_travel_curves_start_at_the_table_and_end_by_staying():
    test, selected = objects(5, 1), select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES)
    rows = travel_rows(selected, test)
    gain = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "cost")]
    first, last = gain.iloc[0], gain.iloc[-1]
    # The first extension with posterior fusion gives the density of the fixed rotations.
    sought, fixed = (
        HeldOutViews(test.estimate_deg, selected[name].evidence)
        for name in ("gain_posterior", "random_posterior")
    )
    error = two_views("information_gain", "posterior", sought).error_deg.mean()
    assert first["error_deg"] == pytest.approx(error, abs=1e-3)
    assert last["travel_deg"] < first["travel_deg"]
    assert gain["travel_deg"].is_monotonic_decreasing
    limits = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "limit")]
    assert (limits["travel_deg"] <= limits["setting"]).all()
    opposite = rows[(rows["rule"] == "fixed") & (rows["setting"] == 180)]
    by_name = opposite.set_index("method")["error_deg"]
    expected = two_views("opposite", "posterior", fixed).error_deg.mean()
    assert by_name["either_way_posterior"] == pytest.approx(expected, abs=1e-3)


def test_pooled_travel_weighs_folds_by_their_images():
    rows = pd.DataFrame(
        {
            "method": "m",
            "rule": "cost",
            "setting": [0.0, 1.0],
            "travel_deg": [100.0, 0.0],
            "error_deg": [4.0, 8.0],
            "n_images": 10,
        }
    )
    other = rows.assign(error_deg=[1.0, 2.0], n_images=30)
    pooled = pooled_travel({1: rows, 2: other})
    assert pooled["error_deg"].tolist() == [(4 + 3) / 4, (8 + 6) / 4]


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


def test_the_legend_of_a_single_panel_stays_inside_the_figure():
    names = ["random", "bisecting", "evenly_spaced", "information_gain", "expected_dispersion"]
    figure = more_views_figure(cells_of([*names, "bayes_error", "pose_ambiguity"]))
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0

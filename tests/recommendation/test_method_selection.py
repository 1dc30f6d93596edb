"""Contest, sequences, sphere and leaderboard, on estimates made for the purpose."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nbv.angles import circular_distance_deg
from nbv.calibration.estimates import Estimates
from nbv.errors import UserError
from nbv.experiments import ablation, travel, two_views
from nbv.experiments import more_views as sequences
from nbv.experiments import view_sphere as sphere
from nbv.recommendation import method_selection as contest
from nbv.recommendation.density_likelihood import most_likely_density
from nbv.recommendation.density_selection import Choice
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.fusion import FUSIONS
from nbv.reporting import sheets
from nbv.reporting.extensions import ablation as ablation_table
from nbv.reporting.extensions import curves, leaderboard
from nbv.reporting.grid import grid_markdown
from nbv.statistics import object_means as standing
from nbv.statistics.paired import Resampler

SETTINGS = {
    "reading": "given_estimate",
    "spread": "entropy",
    "bandwidths_deg": [6, 12],
    "pseudo_observations": [10],
    "n_parts": 2,
}
SEQUENCE = {"n_views": 4, "start_every_deg": 60, "min_separation_deg": 15}
CONTENDERS = {
    "random_posterior": {"rotation": "random", "fusion": "posterior"},
    "opposite_posterior": {"rotation": "opposite", "fusion": "posterior"},
    "gain_posterior": {"rotation": "information_gain", "fusion": "posterior"},
    "error_average": {"rotation": "expected_error", "fusion": "average"},
    "chosen": {"rotation": "chosen", "fusion": "chosen"},
    "opposite_chosen": {"rotation": "opposite", "fusion": "chosen"},
    "oracle_posterior": {"rotation": "oracle", "fusion": "posterior"},
}


def made(n_objects, seed, hidden_deg=90.0):
    """Estimates (n_objects, 360) that guess round one azimuth and are sharp elsewhere."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    spread = 4 + 40 * np.exp(-((circular_distance_deg(truth, hidden_deg) / 35) ** 2))
    found = np.round((truth + rng.normal(0, spread, (n_objects, 360))) % 360, 4) % 360
    names = tuple(f"{seed}-{k}" for k in range(n_objects))
    return Estimates(names, found, np.ones(found.shape))


@pytest.fixture(scope="module")
def entries():
    return contest.enter(made(6, 0), CONTENDERS, SETTINGS)


@pytest.fixture(scope="module")
def frames(entries):
    test, rng = made(5, 1), np.random.default_rng(0)
    return {name: two_views.evaluate_entry(entry, test, rng) for name, entry in entries.items()}


def test_the_pair_chosen_is_the_first_that_is_not_surely_worse_than_the_best(entries):
    names = ["opposite_posterior", "gain_posterior", "error_average"]
    choices = {name: entries[name].choice for name in names}
    best = min(choices.values(), key=lambda choice: choice.error_deg)
    first = next(name for name in names if not contest.surely_better(best, choices[name]))
    assert first != "opposite_posterior"
    chosen = entries["chosen"]
    assert (chosen.rotation, chosen.fusion) == (entries[first].rotation, entries[first].fusion)
    assert chosen.choice == choices[first]
    assert entries["opposite_chosen"].rotation == "opposite"
    assert entries["opposite_chosen"].fusion == chosen.fusion


def choice(*object_error_deg):
    mean = float(np.mean(object_error_deg))
    return Choice(4, 3, {(4, 3): mean}, object_error_deg)


@pytest.mark.parametrize(
    ("one", "other", "sure"),
    [
        ((1.0, 2.0, 3.0), (2.0, 3.1, 4.0), True),
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), False),
        ((1.0, 9.0, 1.0), (2.0, 2.0, 8.0), False),
        ((1.0,), (9.0,), False),
        ((1.0, 2.0), (2.0, 6.0), False),  # -2.5 on average, but from two objects: t = 1.67 < 1.84
        ((1.0, 2.0), (2.0, 5.0), True),
    ],
)
def test_surely_better_needs_more_than_one_standard_error(one, other, sure):
    assert contest.surely_better(choice(*one), choice(*other)) == sure


def test_where_no_criterion_is_surely_better_opposite_is_taken():
    """One calibration object says nothing about others."""
    found = contest.enter(made(1, 0), CONTENDERS, SETTINGS)
    assert found["chosen"].rotation == "opposite"


def test_rows_agree_with_the_estimates_they_came_from(entries, frames):
    test = made(5, 1)
    for name, frame in frames.items():
        one = frame.iloc[[3, 400, 1200]]
        for row in one.itertuples():
            which = test.object_ids.index(row.object_id)
            assert row.initial_estimate_deg == test.estimate_deg[which, row.initial_deg]
            seen = test.estimate_deg[which, (row.initial_deg + row.delta_deg) % 360]
            assert row.next_estimate_deg == seen
            fused = FUSIONS[entries[name].fusion](
                row.initial_estimate_deg, seen, row.delta_deg, entries[name].evidence
            )
            assert circular_distance_deg(fused, row.pose_estimate_deg) < 0.05


def test_no_method_is_better_than_the_oracle_with_its_density(frames):
    oracle = frames["oracle_posterior"]["error_deg"].mean()
    for name in ("random_posterior", "opposite_posterior", "gain_posterior"):
        assert frames[name]["error_deg"].mean() > oracle


@pytest.mark.parametrize(
    ("name", "method", "message"),
    [
        ("x", {"rotation": "oposite", "fusion": "average"}, "did you mean 'opposite'"),
        ("x", {"rotation": "fixed", "fusion": "posterio"}, r"contenders\.x\.fusion=posterio"),
        ("single", {"rotation": "fixed", "fusion": "average"}, "name is taken"),
        ("x", {"rotation": "none", "fusion": "average"}, "takes no second view"),
        ("x", {"rotation": "chosen", "fusion": "chosen"}, "none to be chosen"),
    ],
)
def test_a_contender_that_cannot_be(name, method, message):
    with pytest.raises(UserError, match=message):
        contest.check_contenders({name: method}, {"single": {"rotation": "none"}})


def test_a_contender_may_have_its_criterions_name_unless_a_method_has_that_table():
    named = {"fixed": {"rotation": "fixed", "fusion": "posterior"}}
    contest.check_contenders(named, {"proposed": {"rotation": "entropy"}})
    with pytest.raises(UserError, match="name is taken"):
        contest.check_contenders(named, {"mine": {"rotation": "fixed"}})


def test_stored_choices_give_the_same_evidence(entries):
    evidences = contest.stored_evidence(made(6, 0), contest.choices_frame(entries), SETTINGS)
    again = evidences["information_gain"](360)
    np.testing.assert_array_equal(again.viewpoint, entries["gain_posterior"].evidence.viewpoint)
    assert evidences["information_gain"](360) is again


def test_travel_curves_start_at_the_table_and_end_by_staying(entries, frames):
    test = made(5, 1)
    rows = travel.travel_rows(entries, test)
    gain = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "cost")]
    first, last = gain.iloc[0], gain.iloc[-1]
    frame = frames["gain_posterior"]
    assert first["error_deg"] == pytest.approx(frame["error_deg"].mean(), abs=1e-3)
    assert last["travel_deg"] < first["travel_deg"]
    assert gain["travel_deg"].is_monotonic_decreasing
    limits = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "limit")]
    assert (limits["travel_deg"] <= limits["setting"]).all()
    opposite = rows[(rows["rule"] == "fixed") & (rows["setting"] == 180)]
    by_name = opposite.set_index("method")["error_deg"]
    # The first entry with posterior fusion lends its density.
    expected = two_views.evaluate_entry(
        contest.Entry(
            "opposite",
            "posterior",
            entries["random_posterior"].choice,
            entries["random_posterior"].evidence,
            None,
        ),
        test,
        np.random.default_rng(0),
    )["error_deg"].mean()
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
    pooled = travel.pooled_travel({1: rows, 2: other})
    assert pooled["error_deg"].tolist() == [(4 + 3) / 4, (8 + 6) / 4]


def test_every_look_is_where_it_says_and_counts_its_travel():
    test = made(3, 2)
    evidences = contest.stored_evidence(
        made(6, 0), contest.choices_frame(contest.enter(made(6, 0), CONTENDERS, SETTINGS)), SETTINGS
    )
    rng = np.random.default_rng(0)
    rows = sequences.sequence_rows(test, evidences, SEQUENCE, rng)
    means = rows.groupby(["method", "n_views"])[["error_deg", "travel_deg"]].mean()
    assert means.loc[("bisecting", 4), "travel_deg"] == 180 + 90 + 180
    assert means.loc[("evenly_spaced", 4), "travel_deg"] == 270
    assert means.loc[("evenly_spaced", 3), "travel_deg"] == 240
    assert (means.xs(1, level="n_views")["travel_deg"] == 0).all()
    for method in ("random", "bisecting", "information_gain"):
        assert means.loc[(method, 4), "error_deg"] < means.loc[(method, 1), "error_deg"]
    sheet = sheets.sequence_sheet({"mug": rows.assign(fold=1)}, Resampler(0, 200))
    text = grid_markdown(sheet.title, sheet.grid, sheet.notes)
    assert "4 views" in text
    three = sheet.cells[(sheet.cells["method"] == "bisecting") & (sheet.cells["n_views"] == 3)]
    gap = means.loc[("bisecting", 3), "error_deg"] - means.loc[("random", 4), "error_deg"]
    assert three["to_random_4"].iloc[0] == pytest.approx(gap)


def test_recommended_looks_keep_their_distance():
    evidences = contest.stored_evidence(
        made(6, 0), contest.choices_frame(contest.enter(made(6, 0), CONTENDERS, SETTINGS)), SETTINGS
    )
    step = sequences.recommended_step("information_gain", evidences["information_gain"](120), 15)
    beliefs = evidences["information_gain"](360).viewpoint[::20]
    taken = np.zeros((len(beliefs), 1), dtype=np.int64)
    rng = np.random.default_rng(0)
    for _ in range(4):
        delta = step(sequences.Walk(beliefs, taken), rng)
        assert circular_distance_deg(taken, delta[:, None]).min() >= 15
        taken = np.column_stack([taken, delta])


def test_random_looks_never_repeat():
    rng = np.random.default_rng(0)
    taken = np.tile(np.arange(359), (50, 1))
    walk = sequences.Walk(np.zeros((50, 360), dtype=np.float32), taken)
    assert (sequences.random_step(walk, rng) == 359).all()


def test_great_circles():
    assert sphere.sphere_travel_deg(180, 0, 0) == pytest.approx(180)
    assert sphere.sphere_travel_deg(0, 0, 60) == pytest.approx(60)
    assert sphere.sphere_travel_deg(180, 60, 75) == pytest.approx(45)
    a, b = np.radians([[30, 20], [75, 140]])
    unit = [np.array([np.cos(e) * np.cos(p), np.cos(e) * np.sin(p), np.sin(e)]) for e, p in (a, b)]
    angle = np.degrees(np.arccos(unit[0] @ unit[1]))
    assert sphere.sphere_travel_deg(120, 30, 75) == pytest.approx(angle)


def test_the_sphere_goes_where_the_pose_is_seen():
    """At 0 degrees the pose is hidden half the way round; at 30 it never is."""
    tests = {0: made(4, 3), 30: made(4, 4, hidden_deg=270.0)}
    tests = {e: Estimates(("a", "b", "c", "d"), t.estimate_deg, t.concentration)
             for e, t in tests.items()}  # fmt: skip
    calibrations = {0: made(6, 5), 30: made(6, 6, hidden_deg=270.0)}
    evidences = {}
    for elevation, calibration in calibrations.items():
        found = contest.enter(calibration, CONTENDERS, SETTINGS)
        evidences[elevation] = contest.stored_evidence(
            calibration, contest.choices_frame(found), SETTINGS
        )
    rows = sphere.sphere_rows(tests, evidences, SEQUENCE)
    error = rows.groupby(["method", "elevation_deg"])["error_deg"].mean()
    assert error["information_gain_sphere", 0] < error["opposite", 0]
    circle = rows[rows["method"] == "information_gain_circle"]
    assert (circle["next_elevation_deg"] == circle["elevation_deg"]).all()
    sheet = sheets.sphere_sheet(rows.assign(fold=1), "mug", Resampler(0, 200))
    assert len(sheet.grid.rows) == 2


def object_rows(frames, category, fold):
    means = standing.object_means(frames)
    return means.assign(category=category, elevation_deg=0, fold=fold)


def test_object_means_are_plain_means(frames):
    means = standing.object_means(frames).set_index(["method", "object_id"])
    frame = frames["gain_posterior"]
    mine = frame[frame["object_id"] == "1-2"]
    assert means.loc[("gain_posterior", "1-2"), "error_deg"] == pytest.approx(
        mine["error_deg"].mean()
    )
    shorter = np.minimum(mine["delta_deg"], 360 - mine["delta_deg"]).mean()
    assert means.loc[("gain_posterior", "1-2"), "travel_deg"] == pytest.approx(shorter)


def test_bold_only_where_the_interval_says_so():
    rng = np.random.default_rng(0)
    rows = []
    for category, offset in (("clear", 3.0), ("close", 0.05)):
        for method, shift in (("opposite", offset), ("proposed", offset), ("chosen", 0.0)):
            noise = rng.normal(0, 0.5, 30)
            rows += [
                (category, 0, 1 + k % 5, method, f"{k:02d}", 360, 10 + shift + noise[k], 90.0)
                for k in range(30)
            ]
    columns = ["category", "elevation_deg", "fold", *standing.OBJECT_COLUMNS]
    blocks = leaderboard.blocks_of({"run": pd.DataFrame(rows, columns=columns)})
    sheet = leaderboard.leaderboard(blocks, Resampler(0, 500))
    text = {row[0].text: row for row in sheet.grid.rows}
    assert text["chosen"][1].best
    assert not text["chosen"][2].best
    assert "*" in text["chosen"][2].text
    assert sheet.grid.rows[0][0].text == "chosen"


def test_the_ablations_first_row_is_the_papers_method_and_every_other_changes_it():
    space = ablation.ablation_space()
    assert dict(space.iloc[0].drop("varied")) == dict(ablation.PAPER)
    assert not space.drop(columns="varied").duplicated().any()
    calibration, test = made(6, 0), made(5, 1)
    plain = ablation.ablate(calibration, test, ablation.PAPER, SETTINGS)
    choice = {"rotation": "entropy", "fusion": "average"}
    entry = contest.enter(calibration, {"paper": choice}, SETTINGS)["paper"]
    frame = two_views.evaluate_entry(entry, test, np.random.default_rng(0))
    expected = frame.groupby("object_id")["error_deg"].mean()
    np.testing.assert_allclose(plain.set_index("object_id")["error_deg"], expected, atol=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"chosen_by": "given", "bandwidth_deg": 6.0, "pseudo_observations": 10.0},
        {"chosen_by": "likelihood"},
        {"n_bins": 72},
        {"n_calibration": 2},
        {"criterion": "expected_error", "fusion": "posterior"},
    ],
)
def test_every_kind_of_ablation_gives_an_error_for_each_object(change):
    calibration, test = made(6, 0), made(5, 1)
    found = ablation.ablate(calibration, test, {**ablation.PAPER, **change}, SETTINGS)
    assert found["object_id"].tolist() == list(test.object_ids)
    assert found["error_deg"].between(0, 60).all()


def test_the_most_likely_density_is_found_by_trying_all():
    calibration = made(4, 0).estimate_deg
    grid = SETTINGS | {"bandwidths_deg": [3, 12], "pseudo_observations": [1, 100]}
    choice = most_likely_density(calibration, grid, n_bins=60)
    totals = {}
    for bandwidth in (3, 12):
        for alpha in (1, 100):
            total = 0.0
            for part in range(2):
                evidence = gather_evidence(
                    calibration[np.arange(4) % 2 != part],
                    SETTINGS,
                    bandwidth_deg=bandwidth,
                    pseudo_observations=alpha,
                    n_bins=60,
                )
                for row in calibration[np.arange(4) % 2 == part]:
                    for view, estimate in enumerate(row):
                        e, g = (int(x / 6 + 0.5) % 60 for x in (estimate, view))
                        total += np.log(evidence.likelihoods.viewpoint[e, g])
            totals[bandwidth, alpha] = total
    best = max(totals, key=totals.__getitem__)
    assert (choice.bandwidth_deg, choice.pseudo_observations) == best


def test_the_ablation_holds_each_row_against_the_first():
    rng = np.random.default_rng(0)
    space = ablation.ablation_space().iloc[:3]
    base = rng.uniform(5, 10, 40)
    found = {
        row: pd.DataFrame(
            {"object_id": [f"{k:02d}" for k in range(40)], "fold": 1, "error_deg": base + shift}
        )
        for row, shift in enumerate((0.0, -1.0, 1.0))
    }
    sheet = ablation_table.ablation_sheet(space, found, "mug", Resampler(0, 200))
    assert sheet.cells["difference"].tolist() == pytest.approx([0.0, -1.0, 1.0])
    assert [row[3].best for row in sheet.grid.rows] == [False, True, False]


def test_the_favoured_pair_has_the_least_validated_error_over_categories():
    rows = pd.DataFrame(
        [
            ("mug", "a", "fixed", 4.0),
            ("mug", "b", "expected_error", 6.0),
            ("car", "a", "fixed", 9.0),
            ("car", "b", "expected_error", 6.0),
            ("car", "b", "expected_error", 8.0),
            ("car", "chosen", "fixed", 0.0),
            ("car", "oracle_average", "oracle", 0.0),
            ("car", "random_posterior", "random", 0.0),
        ],
        columns=["category", "method", "rotation", "validated_error_deg"],
    )
    only_mug_and_car = rows[rows["method"].isin(["a", "b"])]
    assert leaderboard.favoured({"one": only_mug_and_car, "two": rows}) == {"one": "a", "two": "a"}
    dearer = rows.assign(validated_error_deg=rows["validated_error_deg"] + (rows["method"] == "a"))
    assert leaderboard.favoured({"run": dearer}) == {"run": "b"}


def curve_of(methods):
    rows = [("mug", method, views, 9.0 / views) for method in methods for views in (1, 2, 3)]
    return pd.DataFrame(rows, columns=["category", "method", "n_views", "value"])


def test_curves_are_drawn_in_the_houses_style():
    """Wherever they are called from: the spines that the style takes away are gone."""
    axes = curves.sequences(curve_of(["random"])).axes[0]
    assert not axes.spines["top"].get_visible()
    assert not axes.spines["right"].get_visible()


def test_the_legend_of_a_single_panel_stays_inside_the_figure():
    methods = ["random", "bisecting", "evenly_spaced", *sequences.BELIEF_CRITERIA]
    figure = curves.sequences(curve_of(methods))
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0

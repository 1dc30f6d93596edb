"""The study `rotations`, on made pairs and on a published estimator's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from studies.rotation_tables import by_symmetry, orientation_table
from studies.rotations import FUSIONS, TwoViews, chosen_views, evaluate, held_out, recommended_view

from nbv.core.orientations.belief import belief
from nbv.core.orientations.criteria import NextViews, bayes_error, view_angle_deg
from nbv.errors import UserError
from rotation_pairs import orientation_pairs

PAIRS = Path(__file__).parents[3] / "shared/data/estimates/tless_megapose.csv"
SETTINGS = {"concentration": 50.0, "pseudo_observations": 10.0, "flip_deg": 20.0}


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    path = tmp_path_factory.mktemp("pairs") / "pairs.csv"
    orientation_pairs().to_csv(path, index=False)
    return path


def test_every_method_is_evaluated_on_every_instance(pairs):
    figures = evaluate(pairs, None, {**SETTINGS, "objects": [], "score_objects": []})
    wide = figures.pivot_table(values="mean_deg", index="method", columns="fusion")
    assert set(wide.columns) == set(FUSIONS)
    assert wide.notna().all(axis=None)
    assert len(figures) == 4 * len(FUSIONS) * len(wide)
    # One view is the same under every fusion; the best in hindsight bounds every method.
    assert np.ptp(wide.loc["single"]) == 0
    assert (wide.loc["hindsight"] <= wide.drop(index="single") + 1e-9).all(axis=None)

    freely = {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}
    groups = by_symmetry(["0", "1"], {"1": freely})
    table = orientation_table(figures, groups, 100, np.random.default_rng(0))
    cells = table.cells.set_index(["group", "fusion", "method"])
    for object_id, group in (("0", "no symmetry or a discrete one"), ("1", "turning freely")):
        own = figures[figures["object_id"] == object_id].groupby(["fusion", "method"])
        expected = own["mean_deg"].mean()
        for (fusion, method), value in expected.items():
            cell = cells.loc[group, fusion, method]
            assert cell["mean_deg"] == pytest.approx(value)
            assert cell["ci_low"] <= value + 1e-9
            assert cell["ci_high"] >= value - 1e-9
            less = value - expected[fusion, "random"]
            assert cell["less_random"] == pytest.approx(less)


@pytest.mark.parametrize(("of_training", "of_instance"), [(2.0, 0.0), (0.0, 6.0)])
def test_intervals_contain_the_chance_of_training(of_training, of_instance):
    """Trainings are drawn within each category, and then instances."""
    rng = np.random.default_rng(1)
    rows = []
    for training in range(8):
        category, error = "ab"[training // 4], 10.0 * (1 + training // 4)
        error += of_training * rng.normal()
        for k in range(30):
            own = {"object_id": category, "training": training, "instance": f"{training}-{k}"}
            own_error = error + of_instance * rng.normal()
            for method in ("single", "random", "opposite"):
                found = own_error * (1 + (method == "single"))
                rows.append(own | {"fusion": "average", "method": method, "mean_deg": found})
    figures = pd.DataFrame(rows).assign(median_deg=0.0, above_30=0.0, within_15=1.0)
    groups = {"a": ["a"], "both": ["a", "b"]}
    cells = orientation_table(figures, groups, 1000, rng).cells.set_index(["group", "method"])
    errors = figures.query("method == 'random'").groupby("training")["mean_deg"].apply(np.array)
    for group, n_categories in (("a", 1), ("both", 2)):
        drawn = [
            np.mean(
                [
                    rng.choice(errors[4 * category + k], 30)
                    for category in range(n_categories)
                    for k in rng.integers(4, size=4)
                ]
            )
            for _ in range(1000)
        ]
        found = cells.loc[group, "random"]
        assert found["mean_deg"] == pytest.approx(np.mean([*errors[: 4 * n_categories]]))
        wanted = np.quantile(drawn, [0.025, 0.975])
        assert [found["ci_low"], found["ci_high"]] == pytest.approx(wanted, abs=0.3)
        assert cells.loc[group, "single"]["less_random"] == pytest.approx(found["mean_deg"])


def test_methods_choose_by_cost_turn_and_hindsight():
    angle = np.array([[0, 20, 170, 90], [20, 0, 150, 70], [170, 150, 0, 80], [90, 70, 80, 0.0]])
    error = np.array([[9, 1, 5, 3], [1, 9, 5, 3], [2, 2, 9, 1], [4, 1, 8, 9.0]])
    cost = np.array([[0, 2, 2, 1], [3, 0, 3, 3], [1, 2, 0, 3], [1, 1, 0.5, 0.0]])
    costs = {"bayes_error": cost}
    views = TwoViews(
        {"posterior": error}, costs, angle, np.array([1, 2, 3, 0]), depends_on_view=True
    )
    chosen = chosen_views(views, "posterior")
    assert chosen["single"].ravel().tolist() == [0, 1, 2, 3]
    assert chosen["random"].tolist() == [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
    assert chosen["opposite"].ravel().tolist() == [2, 2, 0, 0]
    # Never the first view again; of equal costs the nearest.
    assert chosen["bayes_error"].ravel().tolist() == [3, 0, 0, 2]
    assert chosen["farthest_if_independent"].tolist() == chosen["bayes_error"].tolist()
    assert chosen["nbv_next"].ravel().tolist() == [1, 2, 3, 0]
    assert chosen["hindsight"].ravel().tolist() == [1, 0, 3, 1]
    # The best of one half of the images, and the image of the other half nearest to it.
    assert chosen["oracle"].tolist() == [[3, 2], [3, 2], [0, 1], [0, 1]]
    independent = chosen_views(replace(views, depends_on_view=False), "posterior")
    assert independent["farthest_if_independent"].ravel().tolist() == [2, 2, 0, 0]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda table: table.drop(columns="R_true"), "no column 'R_true'"),
        (lambda table: table.assign(R_true="1 0 0 0 1 0 0 0 -1"), "a reflection"),
    ],
)
def test_a_wrong_table_is_refused(pairs, tmp_path, damage, message):
    path = tmp_path / "pairs.csv"
    damage(pd.read_csv(pairs)).to_csv(path, index=False)
    settings = {**SETTINGS, "objects": [], "score_objects": []}
    with pytest.raises(UserError, match=message):
        evaluate(path, None, settings)
    settings |= {"objects": ["7"], "score_objects": ["0"]}
    with pytest.raises(UserError, match="no object 7"):
        evaluate(pairs, None, settings)


@pytest.mark.skipif(not PAIRS.is_file(), reason="../shared/data/estimates is absent")
def test_a_published_estimators_pairs_are_read_with_their_symmetries():
    wanted = {"5": 8.2, "27": 16.1, "17": 54.6, "22": 20.2}  # The page of this data says so.
    settings = {**SETTINGS, "objects": [*wanted], "score_objects": [*wanted]}
    errors: dict[str, list[float]] = {name: [] for name in wanted}
    for case in held_out(PAIRS, PAIRS.parent / "bop/models_info.json", settings):
        errors[case.images.object_ids[0]].extend(case.images.errors().error_deg)
    assert {name: np.mean(each) for name, each in errors.items()} == pytest.approx(wanted, abs=0.06)


def test_the_products_recommendation_is_its_choice(pairs):
    """By the scores too, among images that are not too near to the first one."""
    settings = {**SETTINGS, "objects": [], "score_objects": []}
    for case in held_out(pairs, None, settings):
        images = case.images
        assert not set(zip(case.known.object_id, case.known.group, strict=True)) & {
            (images.object_id[0], images.group[0])
        }
        for i in range(2):
            chosen = recommended_view(case, i)
            moves = images.truth @ images.truth[i].T
            angle = view_angle_deg(moves)
            assert angle[chosen] >= 15
            errors = case.known.errors(images.object_ids[0])
            first = belief(errors, images.estimate[[i]], np.eye(3)[None], case.scores[[i]])
            cost = np.where(angle < 15, np.inf, bayes_error(NextViews(first, moves)))
            assert cost[chosen] == pytest.approx(cost.min(), abs=1e-4)

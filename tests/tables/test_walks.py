"""What further views bring, by walks over calibration images."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from studies.rotation_tables import method_errors
from studies.rotations import evaluate

import nbv
from nbv.cli import main
from nbv.tables.bop import read_orientation_table
from nbv.tables.orientation_table import OrientationTable
from nbv.tables.walks import ENDED, NO_FORECAST, Forecast, bounds_of, forecast, stopped
from rotation_pairs import orientation_pairs


def table(path, *numbers):
    orientation_pairs(*numbers).to_csv(path / "pairs.csv", index=False)
    return path / "pairs.csv"


def test_the_forecast_of_all_first_views_is_the_studys(tmp_path, capsys, monkeypatch):
    pairs = table(tmp_path, 2, 3, 4)
    # Of two objects, 66 % are covered by the larger error.
    changes = {"FEWEST_OBJECTS": 2, "LEVELS": (66,)}
    for name, value in changes.items():
        monkeypatch.setattr(f"nbv.tables.walks.{name}", value)
    command = ["calibrate", str(pairs), "--output", str(pairs.with_suffix(".npz"))]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["forecast"]
    walks = evaluate(pairs, None, {"objects": [], "score_objects": [], "draws": 1}, seed=0)
    figures = method_errors(walks).groupby("object_id").mean().mean()
    methods = {"one view": "recommended_1", "opposite": "opposite_2"}
    methods |= {"recommended": "recommended_2", "stopped": "recommended_decision"}
    for name, method in methods.items():
        assert found["error_deg"][name] == pytest.approx(figures["error_deg", method])
    assert found["mean_views"] == pytest.approx(figures["n_views", "recommended_decision"])
    stopping = figures["chance_overall", "recommended_decision"] - found["error_deg"]["stopped"]
    choosing = found["error_deg"]["random"] - found["error_deg"]["recommended"]
    assert OrientationTable.load(pairs.with_suffix(".npz")).bounds_deg == found["bounds_deg"]
    walks = walks[walks["order"] == "recommended"]
    ends = {"one view": walks[walks["n_views"] == 1], "stopped": stopped(walks, ENDED)}
    for stage, rows in ends.items():
        smaller = rows.groupby("object_id")["error_deg"].min()
        assert smaller.max() <= found["bounds_deg"][stage]["66"]
        assert found["bounds_deg"][stage]["66"] in rows["error_deg"].to_list()
    for (mean, low, high), wanted in (
        (found["stopping_deg"], stopping),
        (found["choosing_deg"], choosing),
    ):
        assert mean == pytest.approx(wanted)
        assert low <= mean <= high


def test_only_an_interval_above_0_is_a_saving():
    found = Forecast({}, 1.5, (2.1, 0.4, 3.9), (2.0, -0.1, 3.0), {}).sentence
    assert found.count("is expected to save") == found.count("is not shown to save") == 1
    assert "choosing is expected to save 2.1° (0.4 to 3.9) over" in found


def test_there_is_no_forecast_of_few_objects_or_of_unknown_instances(tmp_path, capsys):
    pairs = table(tmp_path, 5, 3, 4)
    known = read_orientation_table(pairs)
    assert forecast(known.where(known.object_id != "0")) is None
    assert forecast(known.where((known.object_id != "0") | (known.group != "1/0"))) is None
    scenes = np.array([group.split("/")[0] for group in known.group])
    unknown = OrientationTable(known.object_id, scenes, known.estimate, known.truth)
    assert forecast(unknown) is None
    few = ["--object", "0", "--output", str(pairs.with_name("few.npz"))]
    assert main(["calibrate", str(pairs), *few]) == 0
    assert capsys.readouterr().out.endswith(NO_FORECAST + "\n")


@pytest.mark.parametrize("n", [1, 3, 4, 8, 9, 10, 30])
def test_bounds_cover_a_further_error_as_often_as_they_say(n, rng):
    """Each of n + 1 errors is the further one once: the share that is covered is exact."""
    errors = rng.uniform(0, 90, n + 1)
    bounds = [bounds_of(np.delete(errors, i)) for i in range(n + 1)]
    for level in (80, 90):
        rank = math.ceil((n + 1) * level / 100)
        known = [bound.get(str(level)) for bound in bounds]
        if rank > n:
            assert known == [None] * (n + 1)
        else:
            assert sum(errors <= known) == rank
            assert bounds_of(errors + 90).get(str(level)) is None


def test_an_answer_has_the_bounds_of_its_stage(tmp_path, capsys):
    bounds = {"one view": {"80": 9.0}, "stopped": {"80": 3.0, "90": 8.0}}
    known = replace(read_orientation_table(table(tmp_path, 1, 3, 8)), bounds_deg=bounds)
    ended = {1: ["one view", "stopped"], 2: ["stopped"], 4: ["stopped"], 5: []}
    # Flips have the low score.
    stages = {
        0.9: ended,
        0.4: {1: ["one view"], 2: [], 4: ["stopped"], 5: []},
        None: {1: [], 4: []},
    }
    for score, names in stages.items():
        view = nbv.PoseEstimate(np.eye(3), score=score, camera_pose=np.eye(4))
        for n, wanted in names.items():
            found = known.recommend([view] * n, 20).bounds_deg
            assert found == {name: bounds[name] for name in wanted}
    assert not known.recommend([replace(view, score=0.9, camera_pose=None)] * 2, 20).bounds_deg
    assert not known.where(known.score < 0.9).bounds_deg
    known.save(tmp_path / "t.npz")
    (tmp_path / "view.json").write_text('{"R": [1, 0, 0, 0, 1, 0, 0, 0, 1], "score": 0.9}')
    ask = ["next", str(tmp_path / "t.npz"), "--estimate", str(tmp_path / "view.json")]
    ask += ["--sphere", "20"]
    assert main(ask) == 0
    assert "stopped: within 3.0° in 80, 8.0° in 90 of 100" in capsys.readouterr().out
    assert main([*ask, "--until", "9", "--json"]) == 0
    # Another limit stops elsewhere.
    assert json.loads(capsys.readouterr().out)["bounds_deg"] == {"one view": {"80": 9.0}}

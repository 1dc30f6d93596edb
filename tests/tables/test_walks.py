"""What further views bring, by walks over calibration images."""

import json

import numpy as np
import pytest
from studies.rotation_tables import method_errors
from studies.rotations import evaluate

from nbv.cli import main
from nbv.tables.bop import read_orientation_table
from nbv.tables.orientation_table import OrientationTable
from nbv.tables.walks import NO_FORECAST, forecast
from rotation_pairs import orientation_pairs


def table(path, *numbers):
    orientation_pairs(*numbers).to_csv(path / "pairs.csv", index=False)
    return path / "pairs.csv"


def test_the_forecast_of_all_first_views_is_the_studys(tmp_path, capsys, monkeypatch):
    pairs = table(tmp_path, 2, 3, 4)
    monkeypatch.setattr("nbv.tables.walks.FEWEST_OBJECTS", 2)
    command = ["calibrate", str(pairs), "--output", str(pairs.with_suffix(".npz"))]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["forecast"]
    walks = evaluate(pairs, None, {"objects": [], "score_objects": []}, seed=0)
    figures = method_errors(walks).groupby("object_id").mean().mean()
    methods = {"one view": "recommended_1", "opposite": "opposite_2"}
    methods |= {"recommended": "recommended_2", "stopped": "recommended_decision"}
    for name, method in methods.items():
        assert found["error_deg"][name] == pytest.approx(figures["error_deg", method])
    assert found["mean_views"] == pytest.approx(figures["n_views", "recommended_decision"])
    stopping = figures["chance_overall", "recommended_decision"] - found["error_deg"]["stopped"]
    choosing = found["error_deg"]["random"] - found["error_deg"]["recommended"]
    for (mean, low, high), wanted in (
        (found["stopping_deg"], stopping),
        (found["choosing_deg"], choosing),
    ):
        assert mean == pytest.approx(wanted)
        assert low <= mean <= high


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

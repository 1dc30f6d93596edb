"""`nbv next` with a table of azimuths."""

import json

import numpy as np
import pandas as pd
import pytest

from commands import POSE, fails, run
from nbv.choice.moves import moved_camera
from nbv.cli import main
from nbv.tables.lookup import LookupTable


def test_what_does_not_go_with_a_table_is_refused(table, capsys):
    options = ("next", "t.npz", "--estimate")
    for more in (
        ("--until-probability", "0.9"),
        ("--within", "5"),
        ("--not-followed",),
        ("--sphere", "9"),
        ("--object", "1"),
    ):
        message = fails(capsys, *options, "90", *more)
        assert f"{more[0]} does not go with t.npz, which holds azimuths" in message
    assert "no errors in degrees" in fails(capsys, *options, "90", "--until", "5")
    for estimate in (("views.csv",), ("1", "2")):
        message = fails(capsys, *options, *estimate)
        assert "--estimate: t.npz holds azimuths; give one number of degrees" in message


@pytest.mark.parametrize(
    "given", [("--table", "t.npz"), ("--table=t.npz",)], ids=["separate", "joined"]
)
def test_the_former_form_of_next_gives_its_answer_and_a_hint(table, capsys, given):
    wanted = run(capsys, "next", "t.npz", "--estimate", "-30", "--allowed", "-60:60", "--json")
    former = ["recommend", *given, "--estimate", "-30", "--allowed", "-60:60", "--json"]
    assert main(former) == 0
    out, err = capsys.readouterr()
    assert out == wanted
    assert "is now `nbv next TABLE`" in err


def test_an_estimate_has_target_poses_where_camera_and_axis_are_known(table, capsys):
    options = ("next", "t.npz", "--estimate", "90")
    bare = json.loads(run(capsys, *options, "--json"))
    for direction in ((0, 0.1, 2), ()):
        axis = ",".join(map(str, (0.1, -0.2, 0.3, *direction)))
        placed = (*options, "--camera-pose", "pose.json", "--axis", axis)
        printed = json.loads(run(capsys, *placed, "--json"))
        moves = [printed["move"], *printed["alternatives"]]
        assert len(moves) > 1
        assert printed.pop("target_camera_pose") == moves[0]["target_camera_pose"]
        for move in moves:
            rotation_deg = move["rotation_deg"]
            wanted = moved_camera(POSE, (0.1, -0.2, 0.3), direction or (0, 0, 1), rotation_deg)
            assert np.array(move.pop("target_camera_pose")) == pytest.approx(wanted)
        assert printed == bare
    told = run(capsys, *placed).splitlines()
    assert told[:-5] == run(capsys, *options).splitlines()
    wanted = moved_camera(POSE, (0.1, -0.2, 0.3), (0, 0, 1), moves[0]["rotation_deg"])
    rows = [[float(value) for value in line.split()] for line in told[-4:]]
    assert np.array(rows) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize(
    ("criterion", "unit"), [("pose_ambiguity", " nats"), ("expected_error", " degrees")]
)
def test_an_estimate_has_ranked_rotations_within_the_limits(pairs, capsys, criterion, unit):
    main(["calibrate", "pairs.csv", "--output", "t.npz", "--criterion", criterion])
    capsys.readouterr()
    options = ("next", "t.npz", "--estimate", "90")
    cost = LookupTable.load("t.npz").cost[90].astype(float)
    rotations = np.arange(360)
    travel = np.minimum(rotations, 360 - rotations)
    for limits, may in (
        ((), travel > 1),
        (("--max-travel", "100"), (travel > 1) & (travel <= 100)),
        (("--allowed", "-100", "20", "70", "0"), np.isin(rotations, [260, 20, 70])),
        (("--allowed", "-100", "20", "--max-travel", "40"), rotations == 20),
    ):
        printed = json.loads(run(capsys, *options, *limits, "--json"))
        moves = [printed["move"], *printed["alternatives"]]
        assert moves[0]["cost"] == pytest.approx(cost[may].min())
        assert printed["cost_unit"] == unit.strip()
        found = [int(move["rotation_deg"]) % 360 for move in moves]
        assert may[found].all()
        assert [move["cost"] for move in moves] == pytest.approx(cost[found].tolist())
        assert cost[found].tolist() == sorted(cost[found])
        assert len(moves) == may.sum() if may.sum() < 5 else len(moves) > 1
        decision, *told = run(capsys, *options, *limits).splitlines()
        assert told[1].endswith(f"): {criterion} {moves[0]['cost']:.3f}{unit}")
        assert decision.startswith("decision   none: " if unit == " nats" else "decision   one")
        assert told[2:] == [] if len(moves) == 1 else told[2].startswith("or ")
    for limits in (("--allowed", "0", "1", "-1"), ("--max-travel", "1")):
        assert "no admissible rotation" in fails(capsys, *options, *limits)


def test_a_table_that_knows_nothing_recommends_nothing_without_a_word(pairs, capsys):
    known = pd.read_csv(pairs)
    known.assign(estimate_deg=np.random.default_rng(1).uniform(0, 360, len(known))).to_csv("g.csv")
    run(capsys, "calibrate", "g.csv", "--output", "t.npz")
    options = ("next", "t.npz", "--estimate", "90")
    (warning,) = json.loads(run(capsys, *options, "--json"))["warnings"]
    assert f"warning: {warning}" in run(capsys, *options).splitlines()
    assert "no view is better than another" in warning

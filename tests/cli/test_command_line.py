"""The commands: what they print, what they write, and how they fail."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from made_bundles import BINS, COLUMNS, FOCAL_PX, ROWS, WIDTH, frame

pytest.importorskip("cyclopts")

from nbv.bundles.bundle import FORMAT, Bundle
from nbv.bundles.calibration import recalibrated
from nbv.bundles.evaluation import bundle_errors_deg, count_ood, evaluate
from nbv.bundles.recommender import Recommender
from nbv.bundles.recordings import read_manifest, run_network
from nbv.choice.moves import elevation_from_gravity, moved_camera
from nbv.cli import main
from nbv.cli.answers import print_offset
from nbv.cli.arguments import as_paragraphs
from nbv.core.circle.angles import signed_difference_deg
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.offset import FOR_FRAMES, Offset, frame_warning
from nbv.core.circle.selection import DENSITY, chosen_lookup
from nbv.frames.depth_files import read_depth
from nbv.tables.lookup import LookupTable
from nbv.tables.pairs import PairTable

OWN = ("--bundle", "b.safetensors")
POSE = [[0.0, 0.0, 1.0, -0.6], [-1.0, 0.0, 0.0, 0.1], [0.0, -1.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]]


@pytest.fixture
def here(tmp_path, monkeypatch, bundle_file) -> Path:
    """A folder with four frames, a mask, a pose, and the bundle."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "b.safetensors").write_bytes(bundle_file.read_bytes())
    for place in range(4):
        np.save(tmp_path / f"f{place}.npy", frame(place))
    np.save(tmp_path / "m.npy", frame(0) > 0)
    (tmp_path / "pose.json").write_text(json.dumps(POSE))
    return tmp_path


@pytest.fixture
def pairs(here) -> Path:
    rng = np.random.default_rng(0)
    views = np.arange(0, 360, 6)
    rows = [
        (name, view, round(float((view + rng.normal(0, 12)) % 360), 3))
        for name in "ab"
        for view in views
    ]
    table = pd.DataFrame(rows, columns=["object_id", "azimuth_deg", "estimate_deg"])
    table.to_csv(here / "pairs.csv", index=False)
    return here / "pairs.csv"


@pytest.fixture
def manifest(here) -> Path:
    """A turn of one object, with a frame every 15 degrees."""
    (here / "turn").mkdir()
    rows = []
    for place in range(BINS):
        np.save(here / "turn" / f"{place}.npy", frame(place))
        rows.append(("cup", "1", f"turn/{place}.npy", place * WIDTH, 20.0))
    names = ["object_id", "sequence", "file", "azimuth_deg", "elevation_deg"]
    pd.DataFrame(rows, columns=names).to_csv(here / "manifest.csv", index=False)
    return here / "manifest.csv"


def run(capsys, *arguments: str) -> str:
    """What a command prints that succeeds."""
    code = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    return out


def fails(capsys, *arguments: str) -> str:
    """The one line of a command that fails."""
    code = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert code == 2
    assert err.startswith("nbv: error: ")
    if "--json" in arguments:
        assert json.loads(out)["error"]["message"] == err.removeprefix("nbv: error: ").strip()
    else:
        assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.strip()


def same_answer(printed: dict, answer) -> None:
    assert printed["probability_within"] == pytest.approx(answer.probability_within, rel=1e-4)
    assert printed["azimuth_deg"] == pytest.approx(answer.azimuth_deg)
    assert printed["spread_deg"] == pytest.approx(answer.spread_deg)
    assert printed["expected_error_deg"] == pytest.approx(answer.expected_error_deg, rel=1e-4)
    assert printed["belief"] == pytest.approx(answer.belief.tolist(), abs=1e-5)
    assert printed["ood_score"] == pytest.approx(answer.ood_score, rel=1e-4)
    same_move(printed, answer)


def same_move(printed: dict, answer) -> None:
    moves = answer.moves
    for one, move in zip([printed["move"], *printed["alternatives"]], moves, strict=True):
        assert one["rotation_deg"] == move.rotation_deg
        assert one["travel_deg"] == move.travel_deg
        assert one["expected_error_deg"] == pytest.approx(move.expected_error_deg, rel=1e-4)
        assert one["probability_within"] == pytest.approx(move.probability_within, rel=1e-4)
    known = [np.inf if error is None else error for error in printed["error_after_deg"]]
    assert known == pytest.approx(answer.error_after_deg.tolist(), rel=1e-4)


ASSUMED = f"camera     not given for 24 frames: a focal length of {FOCAL_PX:g} px is assumed"


# Recommend


def test_a_recommendation_as_json_is_that_of_the_recommender(here, capsys):
    recommender = Recommender.load("b.safetensors")
    printed = json.loads(run(capsys, "recommend", "f0.npy", "--bundle", "b.safetensors", "--json"))
    same_answer(printed, recommender.recommend(frame(0)))
    assert "target_camera_pose" not in printed
    assert "target_camera_pose" not in printed["move"]
    assert printed["assumed_focal_px"] == FOCAL_PX


def test_every_option_of_a_recommendation_counts(here, capsys):
    (here / "camera.json").write_text(
        json.dumps(
            {"fx": 160.0, "fy": 155.0, "cx": 60.0, "cy": 45.0, "width": COLUMNS, "height": ROWS}
        )
    )
    for place in range(2):
        np.save(here / f"i{place}.npy", np.rint(frame(place) * 1e4).astype(np.uint16))
    recommender = Recommender.load("b.safetensors")
    printed = json.loads(
        run(
            *(capsys, "recommend", "i0.npy", "i1.npy", "--bundle", "b.safetensors", "--json"),
            *("--rotations", "0", "-90", "--depth-scale", "0.0001"),
            *("--intrinsics", "camera.json", "--mask", "m.npy", "m.npy"),
            *("--elevation", "10", "--allowed", "-60", "45", "180", "--max-travel", "120"),
        )
    )
    answer = recommender.recommend(
        [read_depth(f"i{place}.npy", 0.0001) for place in range(2)],
        rotations_deg=[0.0, -90.0],
        intrinsics=(160.0, 155.0, 60.0, 45.0),
        mask=[frame(0) > 0] * 2,
        elevation_deg=10.0,
        allowed_deg=[-60.0, 45.0, 180.0],
        max_travel_deg=120.0,
    )
    same_answer(printed, answer)
    assert printed["move"]["rotation_deg"] in (-60.0, 45.0)
    assert printed["assumed_focal_px"] is None


def test_allowed_rotations_may_stand_in_a_file(here, capsys):
    mask = np.zeros(8, dtype=bool)
    mask[[2, 5]] = True
    np.save("mask.npy", mask)
    np.save("degrees.npy", np.array([90.0, -135.0]))
    np.save("whole.npy", np.array([90, 225], dtype=np.int16))
    options = ("--bundle", "b.safetensors", "--json")
    wanted = run(capsys, "recommend", "f0.npy", *options, "--allowed", "90", "-135")
    for name in ("mask.npy", "degrees.npy", "whole.npy"):
        assert run(capsys, "recommend", "f0.npy", *options, "--allowed", name) == wanted
        assert run(capsys, "recommend", "--allowed", name, "f0.npy", *options) == wanted


def test_the_target_pose_is_a_rotation_about_the_axis(here, capsys):
    options = ("f0.npy", "--bundle", "b.safetensors", "--json", "--camera-pose", "pose.json")
    for axis in ((0.1, -0.2, 0.3), (0.1, -0.2, 0.3, 0.0, 0.1, 2.0)):
        printed = json.loads(run(capsys, "recommend", *options, "--axis", *map(str, axis)))
        direction = axis[3:] or (0.0, 0.0, 1.0)
        moves = [printed["move"], *printed["alternatives"]]
        assert len(moves) > 1
        for move in moves:
            wanted = moved_camera(POSE, axis[:3], direction, move["rotation_deg"])
            assert np.array(move["target_camera_pose"]) == pytest.approx(wanted)
        assert printed["target_camera_pose"] == printed["move"]["target_camera_pose"]


def test_an_axis_is_refused_that_is_not_where_the_object_is_seen(here, capsys):
    camera = f"{FOCAL_PX},{FOCAL_PX},{COLUMNS / 2 - 0.5},{ROWS / 2 - 0.5}"
    options = ("f0.npy", "--bundle", "b.safetensors", "--json")
    known = run(capsys, "recommend", *options, "--intrinsics", camera)
    seen = json.loads(known)["object_position_m"]
    point = (np.array(POSE) @ [*seen, 1.0])[:3]
    placed = (*options, "--camera-pose", "pose.json", "--axis")
    diagonal_m = Bundle.load("b.safetensors").diagonal_m
    for share in (0.9, 1.1):
        axis = ",".join(str(place) for place in point + np.array([0, share * diagonal_m, 5]))
        # Without a principal point nobody knows in which direction the object is.
        assert json.loads(run(capsys, "recommend", *placed, axis))["object_position_m"] is None
        if share < 1:
            printed = json.loads(run(capsys, "recommend", *placed, axis, "--intrinsics", camera))
            assert printed["object_position_m"] == pytest.approx(seen)
        else:
            line = fails(capsys, "recommend", *placed, axis, "--intrinsics", camera)
            assert line.startswith("nbv: error: axis: the object is seen at ")


@pytest.mark.parametrize(
    ("gravity", "elevation", "leans"),
    [
        (("-3", "0", "-3"), -45.0, "90° to the right"),
        (("1", "1.41421356", "1"), 30.0, "35° to the left"),
    ],
)
def test_the_direction_down_gives_the_elevation_and_the_roll(
    here, capsys, gravity, elevation, leans
):
    assert elevation_from_gravity(",".join(gravity).split(",")) == pytest.approx(elevation)
    options = ("recommend", "f0.npy", "--bundle", "b.safetensors", "--json")
    printed = json.loads(run(capsys, *options, "--gravity", *gravity))
    same_answer(
        printed, Recommender.load("b.safetensors").recommend(frame(0), elevation_deg=elevation)
    )
    of_roll = [line for line in printed["warnings"] if "leans" in line]
    assert [leans in line for line in of_roll] == ([] if leans is None else [True])
    down = [float(number) for number in ",".join(gravity).split(",")]
    answer = Recommender.load("b.safetensors").recommend(frame(0), gravity=down)
    assert list(answer.warnings) == printed["warnings"]


def test_a_recommendation_is_told_in_a_few_lines(here, capsys):
    recommender = Recommender.load("b.safetensors")
    answer = recommender.recommend(frame(0))
    out = run(
        *(capsys, "recommend", "f0.npy", "--bundle", "b.safetensors"),
        *("--camera-pose", "pose.json", "--axis", "0", "0", "0"),
    )
    lines = out.splitlines()
    assert lines[0] == f"camera     not given: a focal length of {FOCAL_PX:g} px is assumed"
    assert f"azimuth {answer.azimuth_deg:.1f}° (camera around mug; 1 view)" in lines[1]
    for line, about in zip(lines[2:4], (answer, answer.move), strict=True):
        within = f"({about.probability_within['5']:.0%} within 5°)"
        assert f"expected error {about.expected_error_deg:.1f}° {within}" in line
    assert f"rotate by {answer.move.rotation_deg:+.0f}°" in lines[3]
    for move in answer.alternatives:
        assert f"{move.rotation_deg:+.0f}° ({move.expected_error_deg:.1f}°)" in lines[4]
    assert lines[5] == "target camera pose in the base frame"
    target = moved_camera(POSE, [0, 0, 0], [0, 0, 1], answer.move.rotation_deg)
    found = np.array([[float(number) for number in line.split()] for line in lines[6:]])
    assert found == pytest.approx(target, abs=1e-5)
    two = run(
        *(capsys, "recommend", "f0.npy", "f1.npy", "--rotations", "0", "60"),
        *("--bundle", "b.safetensors", "--intrinsics", "150"),
    )
    assert "; 2 views)" in two
    assert two.startswith("pose ")


def test_the_choice_of_the_last_view_raises_its_expected_error_unless_it_was_not_followed(
    here, capsys
):
    command = ("recommend", "f0.npy", "f1.npy", "--rotations", "0", "60", "--json")
    recommender = Recommender.load("b.safetensors")
    errors = []
    for flags, followed in ((), True), (["--followed"], True), (["--not-followed"], False):
        printed = json.loads(run(capsys, *command, "--bundle", "b.safetensors", *flags))
        answer = recommender.recommend(
            [frame(0), frame(1)], rotations_deg=[0, 60], followed=followed
        )
        same_answer(printed, answer)
        errors.append(printed["expected_error_deg"])
    assert errors[0] == errors[1] > errors[2]


def test_frames_all_round_have_a_pose_and_no_next_view(manifest, capsys):
    frames = [f"turn/{place}.npy" for place in range(BINS)]
    rotations = ("--rotations", *(f"{place * WIDTH:g}" for place in range(BINS)))
    where = ("--camera-pose", "pose.json", "--axis", "0", "0", "0")
    command = ("recommend", *frames, *rotations, "--bundle", "b.safetensors", *where)
    _, pose, _, next_view, *others = run(capsys, *command).splitlines()
    assert "; 24 views)" in pose
    assert next_view.startswith("next view  none: ")
    assert not any(line.startswith(("or ", "target")) for line in others)
    printed = json.loads(run(capsys, *command, "--json"))
    assert printed["move"] is printed["target_camera_pose"] is None
    assert printed["alternatives"] == []
    answer = Recommender.load("b.safetensors").recommend(
        [frame(place) for place in range(BINS)], rotations_deg=np.arange(BINS) * WIDTH
    )
    assert printed["azimuth_deg"] == pytest.approx(answer.azimuth_deg)


def test_until_an_expected_error_is_enough(here, capsys):
    answer = Recommender.load("b.safetensors").recommend(frame(0))
    for less, words in ((-0.01, "one more view"), (0.01, "enough: stop here")):
        until = str(answer.expected_error_deg + less)
        command = ("recommend", "f0.npy", "--bundle", "b.safetensors", "--until", until)
        assert words in run(capsys, *command)
        assert json.loads(run(capsys, *command, "--json"))["enough"] == (less > 0)


@pytest.mark.parametrize(("limit", "is_told"), [(1e-6, True), (1e6, False)])
def test_an_ood_frame_gives_a_warning(here, bundle, capsys, limit, is_told):
    model = replace(bundle.ood, threshold=limit, scales=np.array([[0, 1], [-1e3, 1]]))
    replace(bundle, ood=model).save("limit.safetensors")
    out = run(capsys, "recommend", "f0.npy", "--bundle", "limit.safetensors")
    assert ("warning:" in out) == is_told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give a depth frame"),
        (["f0.npy", "--rotations", "zero"], "--rotations: 'zero' is not a number"),
        (["f0.npy", "--rotations="], "give a number"),
        (["--mask", "m.npy", "f0.npy"], "give frames before --mask"),
        (["f0.npy", "--max-travel", "3"], "relax --allowed or --max-travel"),
        (["f0.npy", "--allowed", "left"], "left: give rotations in degrees, or a .npy file"),
        (["f0.npy", "--far", "0.1"], "have a depth between --near=0 and --far=0.1, of 0."),
        (["f0.npy", "--near", "300"], "--near=300: give metres"),
        (["f0.npy", "--depth-scale", "0.001"], "1000 times as large would fit"),
        (["f0.npy", "--intrinsics", "wide"], "--intrinsics=wide"),
        (["f0.npy", "--camera-pose", "pose.json"], "--camera-pose and --axis belong together"),
        (["f0.npy", "--gravity", "0", "1"], "--gravity has 2 numbers; give three"),
        (
            ["f0.npy", "--gravity", "0,1,0", "--elevation", "0"],
            "--gravity and --elevation: give one",
        ),
    ],
)
def test_what_cannot_be_recommended_is_one_line(here, capsys, arguments, message):
    assert message in fails(capsys, "recommend", *arguments, "--bundle", "b.safetensors")


def test_a_missing_or_damaged_bundle_is_one_line(here, capsys):
    assert "no-such" in fails(capsys, "recommend", "f0.npy", "--bundle", "no-such")
    (here / "m.csv").write_text("object_id,sequence,file,azimuth_deg\ncup,1,f0.npy,0\n")
    (here / "cut.safetensors").write_bytes((here / "b.safetensors").read_bytes()[:1000])
    for command in (
        ("recommend", "f0.npy", "--bundle", "cut.safetensors"),
        ("inspect", "cut.safetensors"),
        ("export", "cut.safetensors", "--onnx", "x.onnx"),
        ("evaluate", "m.csv", "--bundle", "cut.safetensors"),
        ("calibrate", "m.csv", "--bundle", "cut.safetensors", "--output", "x.safetensors"),
    ):
        assert "cut.safetensors" in fails(capsys, *command)


# Calibrate


@pytest.mark.parametrize("criterion", ["pose_ambiguity", "expected_error"])
def test_pairs_give_the_lookup_table_of_the_experiments(pairs, capsys, criterion):
    out = run(capsys, "calibrate", "pairs.csv", "--output", "t.npz", "--criterion", criterion)
    head, tail = out.splitlines()
    table = pd.read_csv(pairs)
    offset = np.median(signed_difference_deg(table["estimate_deg"], table["azimuth_deg"]))
    found = re.fullmatch(r"pairs\.csv: 2 objects; offset ([+-]\d+\.\d)°", head)
    assert float(found[1]) == pytest.approx(offset, abs=0.1)
    assert tail == f"t.npz: {criterion} from 2 objects"
    options = ("--output", "json.npz", "--criterion", criterion, "--json")
    printed = json.loads(run(capsys, "calibrate", "pairs.csv", *options))
    assert printed.pop("offset_deg") == pytest.approx(offset, abs=0.1)
    wanted = {"file": "json.npz", "criterion": criterion, "n_objects": 2, "warning": None}
    wanted |= {"thin": []}
    assert printed == wanted
    assert Path("json.npz").read_bytes() == Path("t.npz").read_bytes()
    estimate_deg = PairTable.load(pairs).estimates.estimate_deg
    LookupTable.of(chosen_lookup(estimate_deg, criterion, DENSITY)).save("wanted.npz")
    assert Path("t.npz").read_bytes() == Path("wanted.npz").read_bytes()
    table = LookupTable.load("t.npz")
    for estimate in (0.0, 123.4, -30.0, 719.6):
        options = ("next", "t.npz", "--estimate", estimate)
        printed = json.loads(run(capsys, *options, "--json"))
        move = printed["move"]
        rotation = move["rotation_deg"]
        assert rotation % 360 == table.recommend(estimate)
        assert -180 < rotation <= 180
        assert move["travel_deg"] == abs(rotation)
        assert printed["criterion"] == criterion
        cost = table.cost[round(estimate) % 360, int(rotation) % 360]
        assert move["cost"] == pytest.approx(float(cost))
        told = run(capsys, *options).splitlines()[1]
        assert told.startswith(f"next view  rotate by {rotation:+g}° (travel {abs(rotation):g}°)")


def test_the_help_names_every_criterion(here, capsys):
    text = " ".join(run(capsys, "calibrate", "--help").split())
    _, _, told = text.partition("Criterion of the lookup table of azimuths: ")
    told, _, _ = told.replace("│", "").partition(".")
    assert set(re.findall(r"[a-z]+_[a-z]+|fixed", told)) == set(CRITERIA)


def test_pairs_may_begin_with_a_byte_order_mark(pairs, capsys):
    text = pairs.read_text()
    options = ("calibrate", "pairs.csv", "--criterion", "expected_error", "--output")
    run(capsys, *options, "plain.npz")
    pairs.write_text(text, encoding="utf-8-sig")
    run(capsys, *options, "marked.npz")
    assert Path("marked.npz").read_bytes() == Path("plain.npz").read_bytes()


def test_a_table_is_made_of_pairs_alone(pairs, capsys):
    for arguments, message in (
        (("pairs.csv", "--output", "t.dat"), "--output=t.dat: give a name that ends in .npz"),
        (("pairs.csv", "--output", "t.safetensors"), "give a name that ends in .npz"),
        (
            ("pairs.csv", "--output", "t.npz", "--intrinsics", "500"),
            "--intrinsics does not go with pairs.csv, which holds azimuths",
        ),
        (("pairs.csv",), "--output"),
        (
            ("pairs.csv", "--output", "t.npz", "--criterion", "expected_eror"),
            "did you mean 'expected_error'?",
        ),
    ):
        assert message in fails(capsys, "calibrate", *arguments)
    assert not list(Path().glob("*t.*"))


def sweeps_of(manifest):
    recommender = Recommender.load("b.safetensors")
    return [run_network(recommender, one, None, None, print) for one in read_manifest(manifest)]


@pytest.mark.slow
def test_a_manifest_gives_the_bundle_of_that_camera(manifest, capsys):
    out = run(
        *(capsys, "calibrate", "manifest.csv"),
        *("--bundle", "b.safetensors", "--output", "own.safetensors"),
    )
    camera, head, warning, tail = out.splitlines()
    assert camera == ASSUMED
    assert re.fullmatch(r"cup, sequence 1: 24 frames; offset -\d+\.\d°", head)
    # A network of random weights has no zero.
    assert warning.startswith("warning: ")
    assert tail == "own.safetensors: mug, calibrated on 1 recording"
    wanted = recalibrated(Bundle.load("b.safetensors"), sweeps_of(manifest), "manifest.csv")
    wanted.save("wanted.safetensors")
    assert Path("own.safetensors").read_bytes() == Path("wanted.safetensors").read_bytes()
    options = ("--bundle", "b.safetensors", "--output", "json.safetensors", "--json")
    about = json.loads(run(capsys, "calibrate", "manifest.csv", *options))
    (recording,) = about.pop("recordings")
    assert about == {
        "file": "json.safetensors",
        "category": "mug",
        "n_objects": 1,
        "assumed_focal_px": FOCAL_PX,
        "n_frames_without_camera": 24,
        "left_out": [],
    }
    assert f"{recording.pop('offset_deg'):+.1f}°" in head
    assert f"warning: {recording.pop('warning')}" == warning
    own = {"object_id": "cup", "sequence": "1", "n_frames": 24, "is_added": False}
    assert recording == own
    assert Path("json.safetensors").read_bytes() == Path("wanted.safetensors").read_bytes()
    printed = json.loads(
        run(capsys, "recommend", "f0.npy", "--bundle", "own.safetensors", "--json")
    )
    same_answer(printed, Recommender.load("wanted.safetensors").recommend(frame(0)))


def test_a_turn_with_a_gap_does_not_calibrate(manifest, capsys):
    rows = pd.read_csv(manifest).iloc[3:]
    rows.to_csv("gap.csv", index=False)
    options = ("--bundle", "b.safetensors", "--output", "x.safetensors")
    assert main(["calibrate", "gap.csv", *options]) == 2
    out, err = capsys.readouterr()
    assert err.startswith("nbv: error: object 'cup', sequence '1': views leave a gap of 60°")
    assert err.count("\n") == 1
    # What was found before stays: the offset tells which frames there are.
    assert "cup, sequence 1: 21 frames" in out
    assert not Path("x.safetensors").exists()


def test_what_does_not_go_with_frames_is_refused(manifest, capsys):
    options = ("calibrate", "manifest.csv", "--bundle", "b.safetensors", "--output")
    assert "ends in .safetensors" in fails(capsys, *options, "own.npz")
    more = ("own.safetensors", "--criterion", "expected_error")
    message = fails(capsys, "calibrate", "manifest.csv", "--output", "own.npz")
    assert "ends in .safetensors" in message
    message = "--criterion does not go with manifest.csv, which holds frames"
    assert message in fails(capsys, *options, *more)
    # Pairs may have the columns of a manifest too.
    pd.read_csv(manifest).assign(estimate_deg="north").to_csv("both.csv")
    message = fails(capsys, "calibrate", "both.csv", "--output", "own.npz")
    assert "row 2: estimate_deg 'north' is not a finite number" in message


@pytest.mark.slow
def test_the_camera_is_assumed_where_neither_manifest_nor_option_has_it(manifest, capsys):
    rows = pd.read_csv(manifest)
    rows.assign(fx=[FOCAL_PX] * 20 + [np.nan] * 4).to_csv("some.csv")
    rows.assign(fx=FOCAL_PX).to_csv("all.csv")
    options = ("--bundle", "b.safetensors")
    cases = (
        ("some.csv", (), ASSUMED.replace("24 frames", "4 frames")),
        ("all.csv", (), None),
        ("manifest.csv", (), ASSUMED),
        ("manifest.csv", ("--intrinsics", FOCAL_PX), None),
    )
    for file, intrinsics, wanted in cases:
        arguments = (capsys, "evaluate", file, *options, "--views", "2", *intrinsics)
        told = [line for line in run(*arguments).splitlines() if line.startswith("camera")]
        assert told == ([] if wanted is None else [wanted])
        printed = json.loads(run(*arguments, "--json"))
        assert printed["assumed_focal_px"] == (None if wanted is None else FOCAL_PX)
    # A calibration takes seconds, and another test shows the line that it prints.
    calibrate = (capsys, "calibrate", "all.csv", *options, "--output", "own.safetensors", "--json")
    assert json.loads(run(*calibrate))["assumed_focal_px"] is None


@pytest.mark.parametrize("command", ["evaluate", "calibrate"])
def test_near_and_far_hold_for_every_frame_of_a_recording(manifest, capsys, command):
    more = ("--views", "2") if command == "evaluate" else ("--output", "own.safetensors")
    options = ("--bundle", "b.safetensors", *more, "--json")
    wanted = json.loads(run(capsys, command, "manifest.csv", *options))
    for place in range(BINS):
        wall = np.where(frame(place) > 0, frame(place), 0.9).astype(np.float32)
        wall[5:20, 5:20] = 0.2
        np.save(f"turn/{place}.npy", wall)
    limits = ("--near", "0.3", "--far", "0.8")
    assert json.loads(run(capsys, command, "manifest.csv", *options, *limits)) == wanted
    for wrong in ((), ("--far", "0.8"), ("--near", "0.3", "--far", "0.31")):
        assert main([command, "manifest.csv", *options, *wrong]) == 2
        assert "every frame" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        (lambda azimuth, estimate: estimate + 14, None),
        (lambda azimuth, estimate: estimate - 20, "offset -19.8°: azimuth origins"),
        (lambda azimuth, estimate: estimate + 180, "origins probably differ"),
        (lambda azimuth, estimate: -estimate, "estimates run opposite to azimuths"),
        (lambda azimuth, estimate: np.radians(estimate), "estimates are radians"),
        (lambda azimuth, estimate: 7.0 * azimuth, "estimates do not follow azimuths"),
    ],
)
def test_pairs_in_another_frame_are_told(pairs, capsys, change, warning):
    table = pd.read_csv(pairs)
    rng = np.random.default_rng(0)
    exact = table["azimuth_deg"] + rng.normal(0, 2, len(table))
    table.assign(estimate_deg=change(table["azimuth_deg"], exact) % 360).to_csv("other.csv")
    options = ("--output", "t.npz", "--criterion", "expected_error")
    _head, *told, _tail = run(capsys, "calibrate", "other.csv", *options).splitlines()
    if warning is None:
        assert told == []
    else:
        (line,) = told
        assert line.startswith("warning: ")
        assert warning in line


@pytest.mark.parametrize(
    ("change", "is_added", "warning"),
    [
        (lambda azimuth: azimuth + 14, True, None),
        (lambda azimuth: azimuth - 90, True, "offset -90.0°: azimuth origins probably differ"),
        (lambda azimuth: azimuth + 170 * (azimuth > 80), True, "is each frame's azimuth right?"),
        (lambda azimuth: -azimuth, False, "estimates run opposite to azimuths"),
        (lambda azimuth: np.radians(azimuth), False, "estimates are radians"),
    ],
)
def test_an_offset_of_frames_is_added_and_a_large_one_told(capsys, change, is_added, warning):
    azimuth_deg = np.arange(0.0, 360.0, 10.0)
    estimate_deg = change(azimuth_deg) % 360
    found = Offset.of(azimuth_deg, estimate_deg, FOR_FRAMES)
    assert (frame_warning(azimuth_deg, estimate_deg) == "") == is_added
    print_offset("cup", "36 frames", found, is_added=is_added)
    head, *told = capsys.readouterr().out.splitlines()
    assert head.endswith(", added to the azimuths") == is_added
    if warning is None:
        assert not told
        assert found.warning is None
    else:
        assert told == [f"warning: {found.warning}"]
        assert warning in told[0]


# Evaluate


def test_several_recordings_show_how_many_are_evaluated(manifest, capsys):
    one = pd.read_csv(manifest)
    pd.concat([one, one.assign(sequence="2")]).to_csv(manifest, index=False)
    command = ["evaluate", "manifest.csv", "--bundle", "b.safetensors", "--views", "2", "--json"]
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["errors"]
    assert err == "evaluated 1 of 2 recordings\nevaluated 2 of 2 recordings\n"


def test_an_evaluation_is_that_of_the_recordings(manifest, capsys):
    wanted = evaluate(Bundle.load("b.safetensors"), sweeps_of(manifest), [2, 3])
    out = run(
        *(capsys, "evaluate", "manifest.csv", "--bundle", "b.safetensors"),
        *("--views", "2", "3", "--json", "--output", "table.csv"),
    )
    printed = json.loads(out)
    pd.testing.assert_frame_equal(pd.DataFrame(printed["errors"]), wanted)
    ood = count_ood(Bundle.load("b.safetensors"), sweeps_of("manifest.csv"))
    assert printed["ood"] == ood.to_dict("records")
    written = pd.read_csv("table.csv", dtype={"object_id": str, "sequence": str})
    pd.testing.assert_frame_equal(written, wanted.round(4))
    text = run(
        *(capsys, "evaluate", "manifest.csv", "--bundle", "b.safetensors", "--views", "2", "3")
    )
    camera, head, wrong, warning, numbers, *lines = text.splitlines()
    assert camera == ASSUMED
    assert head.startswith("cup, sequence 1: 24 frames; offset ")
    worst = ood["wrong"][0][0]
    assert wrong.startswith(f"  wrong, worst first: {worst['file']} ({worst['error_deg']:.0f}°), ")
    # The network of this bundle is random.
    assert warning == f"warning: {ood['warning'][0]}"
    assert "estimates do not follow azimuths" in warning
    assert numbers.split()[-3:] == ["1", "2", "3"]
    *lines, expected = lines
    errors = [f"{error:.1f}" for error in wanted["expected_deg"].dropna()]
    assert re.split("  +", expected.strip()) == ["expected error", *errors]
    assert len(lines) == wanted["choice"].nunique()
    for line in lines:
        choice, *cells = re.split("  +", line.strip())
        rows = wanted[wanted["choice"] == choice]
        assert cells == [
            f"{row.mae_deg:.1f} ({row.mae_without_offset_deg:.1f})" for row in rows.itertuples()
        ]
    options = ("evaluate", "manifest.csv", "--bundle", "b.safetensors", "--until", "90")
    ended = f"expected {wanted['expected_deg'][0]:.1f}, after 1.0 of at most 5 views"
    assert ended in run(capsys, *options)


def test_an_object_that_calibrated_the_bundle_is_named(manifest, capsys):
    options = ("manifest.csv", "--bundle", "b.safetensors")
    run(capsys, "calibrate", *options, "--output", "own.safetensors")
    options = ("evaluate", "manifest.csv", "--views", "2", "--bundle")
    assert "warning: cup: the bundle was calibrated on" in run(capsys, *options, "own.safetensors")
    printed = json.loads(run(capsys, *options, "own.safetensors", "--json"))
    assert printed["calibrated_by"] == ["cup"]
    assert json.loads(run(capsys, *options, "b.safetensors", "--json"))["calibrated_by"] == []


def test_frames_that_are_left_out_do_not_spoil_the_json(manifest, capsys):
    np.save("turn/3.npy", np.zeros((ROWS, COLUMNS), np.float32))
    options = ("evaluate", "manifest.csv", "--bundle", "b.safetensors", "--views", "2")
    assert main([*options, "--json"]) == 0
    out, err = capsys.readouterr()
    printed = json.loads(out)
    assert len(printed["errors"]) == 6
    (left_out,) = printed["left_out"]
    assert left_out["file"].endswith("turn/3.npy")
    assert left_out["reason"] == "empty-mask"
    assert f"3.npy: empty-mask: {left_out['message']}" in err
    told = run(capsys, *options)
    assert "skipping " in told
    # The frame that is left out needs no camera.
    assert printed["n_frames_without_camera"] == 23
    assert "not given for 23 frames" in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["masks.csv"], "turn/2.npy: the mask has 3 × 4 pixels and the frame"),
        (["manifest.csv", "--views", "2.5"], "--views: '2.5' is not an integer"),
        (["manifest.csv", "--output", "x.json"], "--output=x.json: give a name that ends in .csv"),
        (["manifest.csv", "--intrinsics", "30"], "every frame"),
    ],
)
def test_what_cannot_be_evaluated_is_one_line(manifest, pairs, capsys, arguments, message):
    rows = pd.read_csv("manifest.csv").assign(mask="")
    rows.loc[2, "mask"] = "small.npy"
    rows.to_csv("masks.csv", index=False)
    np.save("small.npy", np.ones((4, 3)))
    code = main(["evaluate", *arguments, "--bundle", "b.safetensors"])
    out, err = capsys.readouterr()
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
    assert not out or "skipping" in out


# Inspect and export


def test_inspect_shows_what_a_bundle_holds(here, bundle, capsys):
    about = json.loads(run(capsys, "inspect", "b.safetensors", "--json"))
    assert about["file"] == "b.safetensors"
    assert about["bytes"] == (here / "b.safetensors").stat().st_size
    assert about["format"] == FORMAT
    assert about["category"] == "mug"
    assert about["classes"] == BINS
    assert about["calibration_objects"] == 3
    assert about["calibration_sweeps"] == 6
    assert about["elevations_deg"] == [0.0, 30.0]
    assert about["temperature"] == bundle.temperature
    assert about["network"] == dict(bundle.estimator)
    assert about["affinity"] == dict(bundle.affinity)
    assert about["ood_threshold"] == bundle.ood.threshold
    assert about["extent_m"] == list(bundle.extent_m)
    assert {key: about[key] for key in bundle.provenance} == bundle.provenance
    assert about["calibration_error_deg"] == pytest.approx(bundle_errors_deg(bundle), abs=0.1)
    lines = run(capsys, "inspect", "b.safetensors").splitlines()
    assert lines[0].split() == [
        "calibration_error_deg.one_view",
        str(about["calibration_error_deg"]["one_view"]),
    ]
    # Names within names have a dot, and a line each.
    assert {line.split()[0].partition(".")[0] for line in lines} == set(about)
    assert all("{" not in line for line in lines)


def test_control_characters_of_a_bundle_are_escaped(here, bundle, capsys):
    named = replace(bundle, category="mug\x1b[2J", provenance={"run": "a\x1b]0;b\n"})
    named.save("c.safetensors")
    for arguments in (
        ("inspect", "c.safetensors"),
        ("recommend", "f0.npy", *OWN[:-1], "c.safetensors"),
    ):
        out = run(capsys, *arguments)
        assert "\\x1b" in out
        assert "\x1b" not in out


def test_export_writes_the_network(here, bundle, capsys, rng):
    told = run(capsys, "export", "b.safetensors", "--onnx", "deep/x.onnx")
    assert told == "deep/x.onnx: codes (n, 1, side, side) to logits (n, classes) and hidden layer\n"
    assert (here / "deep/x.onnx").read_bytes() == bundle.network
    printed = json.loads(run(capsys, "export", "b.safetensors", "--onnx", "deep/x.onnx", "--json"))
    assert printed == {
        "file": "deep/x.onnx",
        "codes": ["n", 1, 32, 32],
        "logits": ["n", BINS],
        "hidden": ["n", bundle.estimator["hidden"]],
    }


def test_a_network_that_cannot_be_run_is_one_line(here, bundle, capsys):
    replace(bundle, network=b"no model").save("bad.safetensors")
    for command in (("export", "bad.safetensors", "--onnx", "x.onnx"), ("recommend", "f0.npy")):
        more = ("--bundle", "bad.safetensors") if command[0] == "recommend" else ()
        assert "the bundle's network cannot be run" in fails(capsys, *command, *more)
    assert not (here / "x.onnx").exists()


def test_a_file_that_cannot_be_written_is_one_line(here, pairs, capsys):
    (here / "file").write_text("")
    assert "file" in fails(capsys, "export", "b.safetensors", "--onnx", "file/x.onnx")
    fast = ("--criterion", "expected_error")
    message = fails(capsys, "calibrate", "pairs.csv", "--output", "file/t.npz", *fast)
    assert "file" in message
    assert "Errno" not in message
    # No name of a temporary file, which is longer than the name that was given.
    long = f"{'a' * 250}.npz"
    message = fails(capsys, "calibrate", "pairs.csv", "--output", long, *fast)
    assert message == f"nbv: error: {long}: File name too long"


# Render


def test_a_drawn_frame_is_told(here, capsys):
    told = run(capsys, "render", "--example", "--output", "x.npy")
    printed = json.loads(run(capsys, "render", "--example", "--output", "y.npy", "--json"))
    assert Path("x.npy").read_bytes() == Path("y.npy").read_bytes()
    run(capsys, "render", "--example", "--output", "Z.NPY")
    assert Path("Z.NPY").read_bytes() == Path("y.npy").read_bytes()
    n_pixels = np.count_nonzero(np.load("y.npy"))
    camera = {"fx": 585.0, "fy": 585.0, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}
    assert printed == {"file": "y.npy", "intrinsics": camera, "object_pixels": n_pixels}
    assert told == f"x.npy: {n_pixels} pixels of the object; --intrinsics 585,585,319.5,239.5\n"
    text = " ".join(run(capsys, "render", "--help").split())
    assert "first Kinect: 640 x 480 pixels, a focal length of 585 px" in text


def test_an_axis_of_a_mesh_file_may_begin_with_a_hyphen(here, capsys):
    faces = "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    Path("wedge.obj").write_text(f"v 0 0 0\nv 4 0 0\nv 0 1 0\nv 0 0 1\n{faces}")
    frames = []
    for front in (("--front", "-z"), ("--front=-z",), ("--front", "+z")):
        run(capsys, "render", "wedge.obj", "--up", "+y", *front, "--output", "x.npy")
        frames.append(np.load("x.npy"))
    assert np.array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[0], frames[2])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--output", "x.jpg"), "--output=x.jpg: give a name that ends in .npy or .png"),
        (("--output", "x.npy", "--front", "-z"), "--up and --front are for a mesh file"),
        (
            ("--output", "x.npy", "--diagonal", "5"),
            "--distance=0.8 from an object with --diagonal=5: 7.5 to 100 m are plausible",
        ),
        (("mesh.obj", "--output", "x.npy"), "give a mesh file, or --example"),
        (("--output", "x.npy", "--seed", "1.5"), "--seed: '1.5' is not an integer"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(here, capsys, more, message):
    assert message in fails(capsys, "render", "--example", *more)
    assert not Path("x.npy").exists()


# The program


@pytest.mark.parametrize(
    "rotations",
    [
        ["--rotations", "0", "-90"],
        ["--rotations", "0", "\N{MINUS SIGN}90"],
        ["--rotations=0,\N{EN DASH}90"],
        ["--rotations", "0,-90"],
        ["--rotations=0,-90"],
        ["--rotations", " 0, -90 "],
        ["--rotations", "0", "--rotations", "-90"],
    ],
)
def test_numbers_stand_between_commas_or_spaces(here, capsys, rotations):
    options = ["--bundle", "b.safetensors", "--json"]
    wanted = run(capsys, "recommend", "f0.npy", "f1.npy", *options, "--rotations", "0", "-90")
    assert run(capsys, "recommend", "f0.npy", "f1.npy", *options, *rotations) == wanted
    assert run(capsys, "recommend", *rotations, "f0.npy", "f1.npy", *options) == wanted
    assert run(capsys, "recommend", "f0.npy", *rotations, "f1.npy", *options) == wanted


@pytest.mark.parametrize("command", [["recommend", "f0.npy", "--json"], ["inspect"]])
def test_a_reader_that_has_seen_enough_is_no_error(here, command):
    script = "import sys; from nbv.cli import main; sys.exit(main(sys.argv[1:]))"
    more = ["--bundle", "b.safetensors"] if "recommend" in command else ["b.safetensors"]
    program = subprocess.Popen(
        [sys.executable, "-c", script, *command, *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    program.stdout.close()
    assert program.wait() == 0
    assert program.stderr.read() == b""
    program.stderr.close()


def program(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The program, run by a shell: `nbv` in the command."""
    nbv = f"{sys.executable} -c 'from nbv.cli import run; run()'"
    return subprocess.run(
        ["sh", "-c", command.replace("nbv", nbv)],
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )


def test_characters_that_an_encoding_lacks_are_escaped(here):
    for name, options in (("text", ""), ("json", "--json")):
        command = f"nbv recommend f0.npy --bundle b.safetensors {options}"
        plain, escaped = (
            program(command, PYTHONIOENCODING=encoding) for encoding in ("utf-8", "ascii")
        )
        assert (escaped.returncode, escaped.stderr) == (0, ""), name
        if options:
            assert json.loads(escaped.stdout) == json.loads(plain.stdout)
        else:
            assert escaped.stdout == plain.stdout.replace("°", r"\xb0")


def test_a_closed_stream_is_no_traceback(here):
    done = program("nbv inspect b.safetensors >&-")
    assert done.returncode == 2
    assert (
        done.stderr
        == "nbv: error: standard output is closed: redirect it to a file or to /dev/null\n"
    )
    done = program("nbv inspect b.safetensors 2>&-")
    assert done.returncode == 0
    assert done.stdout == program("nbv inspect b.safetensors").stdout
    # Where there is no place for a mistake's line, output is none.
    done = program("nbv inspect no-such 2>&-")
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk_is_one_line(here, unbuffered):
    line = "nbv: error: standard output: No space left on device\n"
    for command in ("inspect b.safetensors", "inspect b.safetensors --json", "--help"):
        done = program(f"nbv {command} >/dev/full", PYTHONUNBUFFERED=unbuffered)
        assert (done.returncode, done.stderr) == (2, line)
    # Of two mistakes the first is told.
    done = program("nbv inspect no-such --json >/dev/full", PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 2
    assert done.stderr.startswith("nbv: error: no-bundle: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_picture_that_has_no_space_is_one_line(here):
    # The limit holds for matplotlib's cache of fonts, too.
    cache = {"MPLCONFIGDIR": str(here / "cache")}
    command = "nbv recommend f0.npy --bundle b.safetensors --plot"
    assert program(f"{command} first.png", **cache).returncode == 0
    for name in ("x.png", "x.pdf"):
        done = program(f"ulimit -f 2; {command} {name}", **cache)
        assert done.returncode == 2
        assert done.stderr == f"nbv: error: {name}: File too large\n"
        assert not list(here.glob("*.partial*"))
        assert not (here / name).exists()


def test_paths_are_checked_before_a_network_runs(here, capsys, monkeypatch):
    monkeypatch.setattr(Recommender, "load", lambda *_: pytest.fail("too late"))
    frames = ("recommend", "f0.npy")
    assert "--plot=x.gif" in fails(capsys, *frames, "--plot", "x.gif")
    assert "is a file" in fails(capsys, *frames, "--plot", "pose.json/x.png")
    assert "no-pose.npy" in fails(
        capsys, *frames, "--camera-pose", "no-pose.npy", "--axis", "0", "0", "0"
    )
    (here / "locked").mkdir(mode=0o500)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "locked")
    message = fails(capsys, *frames, "--plot", "locked/x.png")
    assert "is not writable" in message
    message = fails(capsys, "evaluate", "m.csv", "--output", "locked/x.csv")
    assert "is not writable" in message


def test_help_and_version_succeed(capsys):
    text = run(capsys, "--help")
    for command in ("recommend", "next", "calibrate", "evaluate", "inspect", "export"):
        assert command in text
        told = run(capsys, command, "--help")
        assert "Usage: nbv" in told
        assert f"Example: nbv {command} " in told
    assert run(capsys, "--version").strip() == __import__("nbv").__version__


def test_each_paragraph_of_the_help_is_one_line_before_it_is_wrapped():
    def command(name: str, limit: int = 3) -> None:
        """Do one thing.

        It is a long story, which takes
        two lines.

        Parameters
        ----------
        name
            Of the thing,
            which is known,
            or not.
        limit
            Of names.
        """

    assert as_paragraphs(command) is command
    assert command.__doc__.splitlines() == [
        *("Do one thing.", "", "It is a long story, which takes two lines.", ""),
        *("Parameters", "----------"),
        *("name", "    Of the thing, which is known, or not.", "limit", "    Of names."),
    ]


def test_unknown_commands_and_options_are_one_line(here, capsys):
    assert "recomend" in fails(capsys, "recomend")
    for command in ("recommend", "calibrate", "evaluate", "inspect", "export"):
        fails(capsys, command, "--no-such-option")


def test_help_imports_nothing_heavy():
    script = (
        "import sys\nfrom nbv.cli import main\ncode = main(['--help'])\n"
        "heavy = {'numpy', 'torch', 'pandas', 'scipy', 'onnxruntime', 'matplotlib'}\n"
        "sys.exit(code or ' '.join(heavy & set(sys.modules)) or 0)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("recommend", "f0.npy", "--far", "0.1", "--bundle", "b.safetensors"), "empty-mask"),
        (("inspect", "no-such"), "no-bundle"),
        (("recommend", "--near", "x"), None),
        (("export", "b.safetensors", "--onnx", "locked/x.onnx"), None),
    ],
)
def test_a_mistake_is_json_where_json_is_wanted(here, capsys, monkeypatch, arguments, name):
    def locked(*_, **__):
        raise PermissionError(13, "Permission denied", "locked")

    monkeypatch.setattr(Path, "mkdir", locked)
    line = fails(capsys, *arguments)
    assert main([*arguments, "--json"]) == 2
    out, err = capsys.readouterr()
    assert err.strip() == line
    assert json.loads(out) == {
        "error": {"name": name, "message": line.removeprefix("nbv: error: ")}
    }


# Without the packages of the experiment

WITHOUT = """
import sys
from importlib.machinery import PathFinder

class Absent(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in sys.argv[1].split() else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Absent
from nbv.cli import main
from nbv.cli.arguments import as_paragraphs
sys.exit(main(sys.argv[2:]))
"""
EXPERIMENT = ("torch", "pyrender", "hydra", "omegaconf", "pydantic", "psutil", "grimp")
EXPERIMENT += ("snakemake", "jinja2", "onnx")


@pytest.mark.parametrize(
    "arguments",
    [
        ("recommend", "f0.npy", "--bundle", "b.safetensors", "--plot", "plot.png"),
        ("next", "table.npz", "--estimate", "90"),
        ("calibrate", "pairs.csv", "--output", "new.npz"),
        ("evaluate", "manifest.csv", "--bundle", "b.safetensors", "--views", "2"),
        ("inspect", "b.safetensors"),
        ("render", "--example", "--output", "new.npy"),
        ("export", "b.safetensors", "--onnx", "new.onnx"),
    ],
    ids=lambda arguments: " ".join(arguments[:2]),
)
def test_a_robot_needs_no_package_of_the_experiment(manifest, pairs, arguments):
    if "table.npz" in arguments:
        main(["calibrate", "pairs.csv", "--output", "table.npz"])
    command = [sys.executable, "-c", WITHOUT, " ".join(EXPERIMENT), *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_what_does_not_go_with_a_table_is_refused(pairs, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    options = ("next", "t.npz", "--estimate")
    for more in (("--until", "5"), ("--not-followed",), ("--sphere", "9"), ("--object", "1")):
        message = fails(capsys, *options, "90", *more)
        assert f"{more[0]} does not go with t.npz, which holds azimuths" in message
    for estimate in (("views.csv",), ("1", "2")):
        message = fails(capsys, *options, *estimate)
        assert "--estimate: t.npz holds azimuths; give one number of degrees" in message


@pytest.mark.parametrize(
    "table", [("--table", "t.npz"), ("--table=t.npz",)], ids=["separate", "joined"]
)
def test_the_former_form_of_next_gives_its_answer_and_a_hint(pairs, capsys, table):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    wanted = run(capsys, "next", "t.npz", "--estimate", "-30", "--allowed", "-60:60", "--json")
    former = ["recommend", *table, "--estimate", "-30", "--allowed", "-60:60", "--json"]
    assert main(former) == 0
    out, err = capsys.readouterr()
    assert out == wanted
    assert "is now `nbv next TABLE`" in err


def test_an_estimate_has_target_poses_where_camera_and_axis_are_known(pairs, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "table.npz")
    options = ("next", "table.npz", "--estimate", "90")
    bare = json.loads(run(capsys, *options, "--json"))
    placed = (*options, "--camera-pose", "pose.json", "--axis", "0.1,-0.2,0.3")
    printed = json.loads(run(capsys, *placed, "--json"))
    moves = [printed["move"], *printed["alternatives"]]
    assert len(moves) > 1
    for move in moves:
        wanted = moved_camera(POSE, (0.1, -0.2, 0.3), (0, 0, 1), move["rotation_deg"])
        assert np.array(move.pop("target_camera_pose")) == pytest.approx(wanted)
    assert printed.pop("target_camera_pose")
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
    turns = np.arange(360)
    travel = np.minimum(turns, 360 - turns)
    for limits, may in (
        ((), travel > 1),
        (("--max-travel", "100"), (travel > 1) & (travel <= 100)),
        (("--allowed", "-100", "20", "70", "0"), np.isin(turns, [260, 20, 70])),
        (("--allowed", "-100", "20", "--max-travel", "40"), turns == 20),
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
        told = run(capsys, *options, *limits).splitlines()
        assert told[1].endswith(f"): {criterion} {moves[0]['cost']:.3f}{unit}")
        assert told[2:] == [] if len(moves) == 1 else told[2].startswith("or ")
    for limits in (("--allowed", "0", "1", "-1"), ("--max-travel", "1")):
        assert "no admissible rotation" in fails(capsys, *options, *limits)


def test_a_range_allows_every_degree_between_its_ends(pairs, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    for given, wanted in (
        (("-60:60",), range(-60, 61)),
        (("-60:-20,", "30:60"), [*range(-60, -19), *range(30, 61)]),
        (("150:210",), range(150, 211)),
        (("-3.5:0",), (-3.5, -2.5, -1.5, -0.5, 0)),
    ):
        for of_what in (("next", "t.npz", "--estimate", "90"), ("recommend", "f0.npy", *OWN)):
            if of_what[0] == "recommend" and len(wanted) == 5:
                continue
            options = (*of_what, "--json", "--allowed")
            assert run(capsys, *options, *given) == run(capsys, *options, *map(str, wanted))
    for given in ("60:-60", "0:361", "5:nan"):
        message = fails(capsys, "next", "t.npz", "--estimate", "90", "--allowed", given)
        assert given in message


def test_a_table_that_knows_nothing_recommends_nothing_without_a_word(pairs, capsys):
    known = pd.read_csv(pairs)
    known.assign(estimate_deg=np.random.default_rng(1).uniform(0, 360, len(known))).to_csv("g.csv")
    run(capsys, "calibrate", "g.csv", "--output", "t.npz")
    options = ("next", "t.npz", "--estimate", "90")
    (warning,) = json.loads(run(capsys, *options, "--json"))["warnings"]
    assert f"warning: {warning}" in run(capsys, *options).splitlines()
    assert "no view is better than another" in warning


def test_angles_beyond_all_turns_are_one_line(pairs, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    table = ("next", "t.npz", "--estimate")
    assert "--estimate=1e+300" in fails(capsys, *table, "1e300")
    assert "allowed rotations" in fails(capsys, *table, "3", "--allowed", "1e300")
    frames = ("recommend", "f0.npy", "f1.npy", *OWN, "--rotations", "0", "1e300")
    assert "rotations" in fails(capsys, *frames)


def test_the_reason_why_a_table_is_refused_is_told(pairs, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    with np.load("t.npz") as stored:
        np.savez("d.npz", **(dict(stored) | {"spread": np.array("width")}))
    message = fails(capsys, "next", "d.npz", "--estimate", "90")
    assert "d.npz: spread is 'width'; make it again with nbv calibrate" in message


def test_what_is_no_lookup_table_is_not_to_be_deleted(pairs, capsys):
    message = fails(capsys, "next", "pairs.csv", "--estimate", "90")
    assert "pairs.csv: cannot be read (it is not an array of numbers)" in message
    assert "give the .npz file that nbv calibrate wrote" in message
    assert "delete" not in message

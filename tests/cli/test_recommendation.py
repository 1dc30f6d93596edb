"""`nbv recommend`: its answers, options and mistakes."""

import json
import lzma
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from commands import POSE, fails, run, same_answer
from made_bundles import BINS, COLUMNS, FOCAL_PX, ROWS, WIDTH, frame
from nbv.bundles.bundle import Bundle
from nbv.bundles.recommender import Recommender
from nbv.choice.moves import elevation_from_gravity, moved_camera
from nbv.frames.depth_files import read_depth

CASES = Path(__file__).parents[3] / "shared" / "cases"


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
    assert [leans in line for line in of_roll] == [True]
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
    decision, *lines = out.splitlines()
    assert decision.startswith("decision   ")
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
    assert two.splitlines()[1].startswith("pose ")


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
    frames = [f"sweep/{place}.npy" for place in range(BINS)]
    rotations = ("--rotations", *(f"{place * WIDTH:g}" for place in range(BINS)))
    where = ("--camera-pose", "pose.json", "--axis", "0", "0", "0")
    command = ("recommend", *frames, *rotations, "--bundle", "b.safetensors", *where)
    _, _, pose, _, next_view, *others = run(capsys, *command).splitlines()
    assert "; 24 views)" in pose
    assert next_view.startswith("next view  none")
    assert not any(line.startswith(("or ", "target")) for line in others)
    printed = json.loads(run(capsys, *command, "--json"))
    assert printed["move"] is printed["target_camera_pose"] is None
    assert printed["alternatives"] == []


def test_the_decision_is_said_first_and_last_in_json(here, capsys):
    answer = Recommender.load("b.safetensors").recommend(frame(0))
    error, probability = answer.expected_error_deg, answer.probability(30.0)
    command = ("recommend", "f0.npy", "--bundle", "b.safetensors")
    bare = json.loads(run(capsys, *command, "--json"))
    for less in (-0.01, 0.01):
        of_error, of_probability = (
            ("--until", str(error + less)),
            ("--until-probability", str(probability - less), "--within", "30"),
        )
        for limits in (of_error, of_probability, of_error + of_probability):
            printed = json.loads(run(capsys, *command, *limits, "--json"))
            verdict, reason = printed["decision"].values()
            assert (verdict == "enough") == (less > 0)
            first, *_ = run(capsys, *command, *limits).splitlines()
            assert first == f"decision   {verdict}: {reason}"
            assert printed["enough"] == (less > 0 if "--until" in limits else None)
            assert list(printed)[-1] == "decision"
            assert printed | {"decision": 0, "enough": 0} == bare | {"decision": 0, "enough": 0}


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
        (["f0.npy", "--within", "5"], "--within is for --until-probability; give that too"),
        (["f0.npy", "--until-probability", "2"], "--until-probability=2: give one between 0"),
        (["f0.npy", "--gravity", "0", "1"], "--gravity has 2 numbers; give three"),
        (
            ["f0.npy", "--gravity", "0,1,0", "--elevation", "0"],
            "--gravity and --elevation: give one",
        ),
        (["f0.npy", "--mask-value", "1"], "--mask-value goes with --mask"),
    ],
)
def test_what_cannot_be_recommended_is_one_line(here, capsys, arguments, message):
    assert message in fails(capsys, "recommend", *arguments, "--bundle", "b.safetensors")


@pytest.mark.skipif(not CASES.is_dir(), reason="../shared/cases is absent")
@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["2/mask_rgba_dark/wall.npz", "--mask", "2/mask_rgba_dark/dark.png"], 0.4),
        (["2/mask_labels/box_r60x60.npz", "--mask", "2/mask_labels/lab3.png"], "which value is"),
        (["2/mask_labels/box_r60x60.npz", "--mask", "2/mask_labels/box_r60x60.png"], "which value"),
        (
            ["2/mask_labels/box_r60x60.npz", "--mask", "2/mask_labels/lab3.png", "--mask-value=1"],
            0.4,
        ),
        (["wall.npz", "--mask", "2/mask_logits/neg.npy"], "has negative values, such as -1"),
        (["wall.npz", "--mask", "2/mask_logits/log.npy"], "has negative values, such as -5"),
        (["wall.npz", "--mask", "2/mask_logits/neg.npy", "--mask-value", "3"], 0.4),
        (["2/depth_1hw/1hw.npy"], 0.4),
        (["2/depth_1hw/11hw.npy"], 0.4),
        (["side.npz", "--intrinsics", "585,319.5,585,239.5"], "give 585,585,319.5,239.5"),
        (["side.npz", "--intrinsics", "1170,1170,620,470"], "the centre of an image of 1241 × 941"),
    ],
)
def test_the_given_cases_are_answered_rightly_or_in_one_line(
    tmp_path, monkeypatch, capsys, arguments, wanted
):
    for packed in [*CASES.glob("2/mask_*/*.xz"), *CASES.glob("2/depth_*/*.xz")]:
        (tmp_path / packed.parent.relative_to(CASES)).mkdir(parents=True, exist_ok=True)
        (tmp_path / packed.relative_to(CASES).with_suffix("")).write_bytes(
            lzma.decompress(packed.read_bytes())
        )
    monkeypatch.chdir(tmp_path)
    files = [a if Path(a).exists() or not (CASES / a).exists() else CASES / a for a in arguments]
    if "--intrinsics" not in arguments:
        files += ["--intrinsics", "585,585,319.5,239.5"]
    if isinstance(wanted, str):
        assert wanted in fails(capsys, "recommend", *files)
    else:
        answer = json.loads(run(capsys, "recommend", *files, "--json"))
        assert answer["azimuth_deg"] == pytest.approx(wanted, abs=0.1)

"""`nbv calibrate` and `nbv evaluate`."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import fails, run, same_answer
from made_bundles import BINS, COLUMNS, FOCAL_PX, ROWS, frame
from nbv.bundles.bundle import Bundle
from nbv.bundles.calibration import recalibrated
from nbv.bundles.evaluation import count_ood, evaluate
from nbv.bundles.recommender import Recommender
from nbv.bundles.recordings import read_manifest, run_network
from nbv.cli import main
from nbv.core.circle.angles import signed_difference_deg
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.selection import DENSITY, chosen_lookup
from nbv.tables.lookup import LookupTable
from nbv.tables.pairs import PairTable

ASSUMED = f"camera     not given for 24 frames: a focal length of {FOCAL_PX:g} px is assumed"


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
        told = run(capsys, *options).splitlines()[2]
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
        np.save(f"sweep/{place}.npy", wall)
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
    np.save("sweep/3.npy", np.zeros((ROWS, COLUMNS), np.float32))
    options = ("evaluate", "manifest.csv", "--bundle", "b.safetensors", "--views", "2")
    assert main([*options, "--json"]) == 0
    out, err = capsys.readouterr()
    printed = json.loads(out)
    assert len(printed["errors"]) == 6
    (left_out,) = printed["left_out"]
    assert left_out["file"].endswith("sweep/3.npy")
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
        (["masks.csv"], "sweep/2.npy: the mask has 3 × 4 pixels and the frame"),
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

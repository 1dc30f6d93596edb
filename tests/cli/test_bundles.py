"""`nbv inspect`, `export` and `render`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from commands import OWN, fails, run
from made_bundles import BINS
from nbv.bundles.bundle import FORMAT
from nbv.bundles.evaluation import bundle_errors_deg


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

"""Whatever is wrong with what a robot hands over, it gets an answer or one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.fuzz.mutations import mutate

from made_bundles import COLUMNS as WIDTH_PX
from made_bundles import FOCAL_PX, ROWS, frame
from nbv.cli import main

CAMERA = {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": 59.5, "cy": 44.5, "width": WIDTH_PX, "height": ROWS}
ROS = """\
height: 90
width: 120
distortion_model: plumb_bob
k: [150.0, 0.0, 59.5, 0.0, 150.0, 44.5, 0.0, 0.0, 1.0]
---
"""


@pytest.fixture
def here(tmp_path, monkeypatch, bundle_file) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("b.safetensors").write_bytes(bundle_file.read_bytes())
    depth = frame(0)
    np.save("frame.npy", depth)
    np.savez("frame.npz", depth=depth)
    millimetres = np.rint(1000 * depth).astype(np.uint16)
    for suffix in ("png", "tif", "pgm"):
        Image.fromarray(millimetres).save(f"frame.{suffix}")
    Image.fromarray(((depth > 0) * 255).astype(np.uint8)).save("mask.png")
    np.save("mask.npy", depth > 0)
    Path("camera.json").write_text(json.dumps(CAMERA))
    Path("camera.yaml").write_text(ROS)
    np.save("pose.npy", np.eye(4))
    return tmp_path


def odd_frame(rng: np.random.Generator) -> np.ndarray:
    """A frame of another kind, unit, shape or content."""
    depth = frame(int(rng.integers(0, 20)))
    odd = [
        depth * rng.choice([1e-6, 0.001, 0.01, 10, 1000, 1e6, 1e38]),
        -depth,
        depth.T,
        depth[: rng.integers(0, ROWS), : rng.integers(0, WIDTH_PX)],
        np.where(rng.random(depth.shape) < rng.random(), depth, np.nan),
        np.full_like(depth, rng.choice([0.0, 0.5, np.nan, np.inf, -np.inf])),
        rng.normal(0.5, 0.2, depth.shape),
        np.repeat(depth[..., None], rng.integers(1, 5), axis=2),
        depth.astype(rng.choice(["int8", "uint8", "int64", "bool", "complex64", "float16", "U8"])),
        np.array(rng.normal()),
        np.maximum(depth, np.roll(depth, int(rng.integers(20, 60)), axis=1)),
        np.rint(1000 * depth).astype(np.int32) * int(rng.integers(-3, 4)),
    ]
    return odd[rng.integers(0, len(odd))]


def one_line_or_an_answer(capsys, *arguments: object) -> bool:
    """Run `nbv recommend`; whether it gave an answer."""
    code = main(["recommend", *map(str, arguments), "--bundle", "b.safetensors", "--json"])
    out, err = capsys.readouterr()
    if code == 0:
        answer = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in the answer"))
        assert 0 <= answer["azimuth_deg"] < 360
        return True
    assert code == 2
    assert err.strip() == f"nbv: error: {json.loads(out)['error']['message']}"
    assert err.startswith("nbv: error: ")
    assert err.count("\n") == 1
    return False


@pytest.mark.parametrize(
    ("name", "option"),
    [
        *((f"frame.{suffix}", None) for suffix in ("npy", "npz", "png", "tif", "pgm")),
        *((name, "--mask") for name in ("mask.png", "mask.npy")),
        *((name, "--intrinsics") for name in ("camera.json", "camera.yaml")),
        ("pose.npy", "--camera-pose"),
    ],
)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.slow
def test_damaged_files_are_one_line_or_an_answer(here, capsys, name, option):
    content, damaged_name = Path(name).read_bytes(), f"damaged{Path(name).suffix}"
    rng = np.random.default_rng(list(name.encode()))
    used = [damaged_name] if option is None else ["frame.npy", option, damaged_name]
    if option == "--camera-pose":
        used += ["--axis", "0", "0", "0", "0", "-1", "0"]
    Path(damaged_name).write_bytes(content)
    assert one_line_or_an_answer(capsys, *used)
    for _ in range(40):
        Path(damaged_name).write_bytes(mutate(content, [b"{}"], rng))
        one_line_or_an_answer(capsys, *used)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_odd_frames_are_one_line_or_an_answer(here, capsys, rng):
    answers = 0
    for _ in range(200):
        np.save("odd.npy", odd_frame(rng))
        answers += one_line_or_an_answer(capsys, "odd.npy")
    assert 0 < answers < 100

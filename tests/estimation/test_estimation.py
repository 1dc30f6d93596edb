from __future__ import annotations

import numpy as np
import pytest
import torch

from nbv.angles import circular_distance_deg
from nbv.errors import UserError
from nbv.estimation import hardware as hw
from nbv.estimation.images import direction_targets, to_input
from nbv.estimation.inference import estimate_azimuth, estimate_objects
from nbv.estimation.networks import build_network
from nbv.estimation.training import train_estimator, train_regressor
from nbv.estimation.weights import Estimator, load_estimator, save_estimator

SETTINGS = {
    "kind": "regressor",
    "channels": [8, 16],
    "hidden": 32,
    "epochs": 6,
    "batch_size": 32,
    "learning_rate": 3e-3,
    "weight_decay": 1e-2,
}
CPU = hw.Hardware(torch.device("cpu"), torch.float32)


@pytest.fixture(autouse=True)
def one_thread():
    hw.use_one_thread()


def clock_faces(n_objects: int, n_views: int = 72, side: int = 16, seed: int = 0) -> np.ndarray:
    """Images of a hand that points to the azimuth: (n_objects, n_views, side, side) codes."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * np.arange(n_views) / n_views
    rows, columns = np.mgrid[:side, :side] - (side - 1) / 2
    codes = np.zeros((n_objects, n_views, side, side), np.uint8)
    for one in range(n_objects):
        length, width = rng.uniform(5, 7), rng.uniform(1.0, 2.0)
        along = columns * np.cos(angles)[:, None, None] - rows * np.sin(angles)[:, None, None]
        across = columns * np.sin(angles)[:, None, None] + rows * np.cos(angles)[:, None, None]
        codes[one][(along > 0) & (along < length) & (abs(across) < width)] = 128
    return codes


def test_a_regressor_learns_to_read_a_clock_and_the_seed_decides_every_bit():
    faces = clock_faces(12)
    first, again, other = (
        train_regressor(faces[:10], SETTINGS | {"epochs": 12}, CPU, seed) for seed in (1, 1, 2)
    )
    estimate, concentration = estimate_azimuth(first, faces[10:], CPU)
    truth = np.arange(72) * 5.0
    assert circular_distance_deg(estimate, truth).mean() < 6
    assert 0.7 < concentration.mean() < 1.2
    states = [network.state_dict() for network in (first, again, other)]
    assert all(torch.equal(states[0][name], states[1][name]) for name in states[0])
    assert not torch.equal(states[0]["4.weight"], states[2]["4.weight"])


def test_estimates_do_not_depend_on_the_batch():
    network = build_network(SETTINGS, 16).eval()
    faces = clock_faces(1, 20)
    whole, _ = estimate_azimuth(network, faces, CPU)
    parts, _ = estimate_azimuth(network, faces, CPU, batch_size=7)
    np.testing.assert_allclose(circular_distance_deg(whole, parts), 0, atol=1e-3)


def test_an_estimator_comes_back_from_its_file_with_its_history(tmp_path):
    faces = clock_faces(3, 24)
    rows = np.array([0, 2])
    trained = train_estimator(faces, rows, ["a", "c"], SETTINGS | {"epochs": 1}, CPU, 0)
    save_estimator(tmp_path / "estimator.safetensors", trained, CPU)
    read = load_estimator(tmp_path / "estimator.safetensors", CPU)
    assert list(read.trained_on) == ["a", "c"]
    assert read.image_side == 16
    one = estimate_objects(trained, faces, np.array([1]), ["b"], CPU)
    two = estimate_objects(read, faces, np.array([1]), ["b"], CPU)
    np.testing.assert_array_equal(one, two)


def test_objects_that_were_trained_on_are_refused():
    network = build_network(SETTINGS, 16)
    estimator = Estimator(network, SETTINGS, 16, ["a", "b"])
    with pytest.raises(UserError, match="'b' was trained on"):
        estimate_objects(estimator, clock_faces(1, 8), np.array([0]), ["b"], CPU)


def test_images_of_another_size_are_refused():
    estimator = Estimator(build_network(SETTINGS, 16), SETTINGS, 16, [])
    with pytest.raises(UserError, match="32 pixels a side"):
        estimate_objects(estimator, clock_faces(1, 8, side=32), np.array([0]), ["x"], CPU)


def test_a_file_that_is_no_estimator_is_named(tmp_path):
    path = tmp_path / "estimator.safetensors"
    path.write_bytes(b"not weights at all, but long enough to look")
    with pytest.raises(UserError, match=r"estimator\.safetensors: not an estimator"):
        load_estimator(path, CPU)


def test_every_depth_code_is_exact_in_bfloat16():
    codes = np.arange(256, dtype=np.uint8).reshape(1, 16, 16)
    half = to_input(codes, hw.Hardware(torch.device("cpu"), torch.bfloat16))
    np.testing.assert_array_equal(half.float().numpy().ravel(), np.arange(256) / 128)


def test_targets_are_the_unit_vectors_of_each_objects_turn():
    targets = direction_targets(2, 4).numpy()
    np.testing.assert_allclose(targets[:4], [[1, 0], [0, 1], [-1, 0], [0, -1]], atol=1e-7)
    np.testing.assert_array_equal(targets[4:], targets[:4])


@pytest.mark.parametrize("side", [8, 15, 33, 64])
def test_any_image_side_fits_the_network(side):
    assert build_network(SETTINGS, side)(torch.zeros(2, 1, side, side)).shape == (2, 2)


def test_bfloat16_and_float32_answer_alike():
    faces = clock_faces(8)
    network = train_regressor(faces[:7], SETTINGS, CPU, 0)
    full, _ = estimate_azimuth(network, faces[7:], CPU)
    half, _ = estimate_azimuth(network, faces[7:], hw.Hardware(torch.device("cpu"), torch.bfloat16))
    assert np.median(circular_distance_deg(full, half)) < 1.0


@pytest.mark.parametrize(
    ("device", "precision", "message"),
    [
        ("cdua", "auto", "did you mean 'cuda'"),
        ("cpu", "bfloat61", "did you mean 'bfloat16'"),
        ("cpu", "int8", "choose from: auto, bfloat16, float32"),
    ],
)
def test_unknown_hardware(device, precision, message):
    with pytest.raises(UserError, match=message):
        hw.choose_hardware(device, precision)


def test_a_device_that_is_not_there_is_refused():
    if torch.cuda.is_available():
        pytest.skip("this machine has CUDA")
    with pytest.raises(UserError, match="device=cuda: this machine has none"):
        hw.choose_hardware("cuda")


def test_an_unknown_network():
    with pytest.raises(UserError, match=r"estimator\.kind=regresor: did you mean 'regressor'"):
        build_network(SETTINGS | {"kind": "regresor"}, 16)

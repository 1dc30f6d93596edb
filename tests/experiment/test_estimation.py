from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from clock_faces import CLASSES, CPU, NAMES, SETTINGS, clock_faces, named, untrained
from nbv.core.circle.angles import circular_distance_deg
from nbv.errors import UserError
from nbv.experiment.estimation import hardware as hw
from nbv.experiment.estimation.hardware import to_input
from nbv.experiment.estimation.inference import network_outputs, outputs_of_parts
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.outputs import (
    class_targets,
    decode_classes,
    decode_directions,
    direction_targets,
)
from nbv.experiment.estimation.training import train_estimator, train_network
from nbv.experiment.estimation.weights import Estimator, load_estimator, save_estimator


def azimuth_of(estimator, codes, hardware):
    outputs = network_outputs(estimator, codes, hardware)
    return decode_directions(outputs) if outputs.shape[-1] == 2 else decode_classes(outputs)


@pytest.fixture(autouse=True)
def one_thread():
    hw.use_one_thread()


def test_one_thread_computes_and_deterministically():
    assert torch.get_num_threads() == 1
    assert torch.are_deterministic_algorithms_enabled()
    assert torch.is_deterministic_algorithms_warn_only_enabled()


@pytest.mark.parametrize("planes_deg", [None, [90.0, 0.0]])
def test_a_training_is_torchs_adamw_and_one_cycle_schedule_to_the_last_bit(planes_deg):
    faces = clock_faces(2)
    settings = SETTINGS | {"epochs": 2, "weight_decay": 0.1}
    trained = train_network(faces, settings, CPU, 3, mirror_planes_deg=planes_deg)
    torch.manual_seed(3)
    network = build_network(SETTINGS, 16).train()
    images = to_input(faces, CPU)
    targets = torch.from_numpy(np.tile(direction_targets(SETTINGS, 72), (2, 1)))
    mirrored = targets.clone()
    # View k of 72 is at 5 k degrees: in the mirror, 90 + x degrees become 90 - x.
    for view in range(72):
        mirrored[view] = targets[(36 - view) % 72]
        mirrored[72 + view] = targets[-view % 72]
    size, rate = SETTINGS["batch_size"], SETTINGS["learning_rate"]
    batches = len(images) // size
    optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=0.1, fused=True)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, max_lr=rate, total_steps=2 * batches)
    order = torch.Generator().manual_seed(3)
    for _ in range(2):
        for chosen in torch.randperm(len(images), generator=order)[: batches * size].split(size):
            optimiser.zero_grad()
            shown, wanted = images[chosen], targets[chosen]
            if planes_deg is not None:
                half = size // 2
                shown = torch.cat([shown[:half].flip(-1), shown[half:]])
                wanted = torch.cat([mirrored[chosen[:half]], wanted[half:]])
            torch.nn.functional.mse_loss(network(shown), wanted).backward()
            optimiser.step()
            schedule.step()
    expected = network.state_dict()
    assert all(torch.equal(value, expected[name]) for name, value in trained.state_dict().items())


@pytest.mark.parametrize("settings", [SETTINGS, CLASSES])
def test_a_mirror_image_has_the_mirrored_azimuth_where_both_are_averaged(settings):
    codes = clock_faces(2)
    mirrored = replace(untrained(settings), mirror_plane_deg=97.5)
    estimate, other = (azimuth_of(mirrored, each, CPU) for each in (codes, codes[..., ::-1]))
    assert circular_distance_deg(other, 195.0 - estimate).max() < 1e-3
    plain = azimuth_of(replace(mirrored, mirror_plane_deg=None), codes, CPU)
    assert circular_distance_deg(estimate, plain).max() > 1


def test_an_estimator_keeps_the_plane_of_its_mirror_images(tmp_path):
    images = named(clock_faces(2))
    settings = SETTINGS | {"epochs": 1}
    trained = train_estimator(images, images.object_ids, settings, CPU, 0, mirror_plane_deg=90.0)
    save_estimator(tmp_path / "e.safetensors", trained, CPU)
    assert load_estimator(tmp_path / "e.safetensors", CPU).mirror_plane_deg == 90.0


def test_a_regressor_learns_to_read_a_clock_and_the_seed_decides_every_bit():
    faces = clock_faces(12)
    first, again, other = (
        train_network(faces[:10], SETTINGS | {"epochs": 12}, CPU, seed) for seed in (1, 1, 2)
    )
    estimate = azimuth_of(Estimator(first, SETTINGS, 16, []), faces[10:], CPU)
    truth = np.arange(72) * 5.0
    assert circular_distance_deg(estimate, truth).mean() < 6
    states = [network.state_dict() for network in (first, again, other)]
    assert all(torch.equal(states[0][name], states[1][name]) for name in states[0])
    assert not torch.equal(states[0]["4.weight"], states[2]["4.weight"])


def test_a_classifier_learns_to_read_a_clock():
    faces = clock_faces(12)
    settings = CLASSES | {"epochs": 12}
    trained = train_estimator(named(faces), NAMES[:10], settings, CPU, 1)
    estimate = azimuth_of(trained, faces[10:], CPU)
    assert circular_distance_deg(estimate, np.arange(72) * 5.0).mean() < 6


def test_outputs_do_not_depend_on_the_batch():
    estimator, faces = untrained(), clock_faces(1, 20)
    whole = network_outputs(estimator, faces, CPU)
    assert whole.shape == (1, 20, 2)
    np.testing.assert_allclose(whole, network_outputs(estimator, faces, CPU, 7), atol=1e-5)


@given(st.integers(0, 99), st.integers(0, 23), st.floats(0.1, 10))
def test_decoding_rotates_with_the_classes_and_is_the_mean_direction(seed, k, scale):
    logits = scale * np.random.default_rng(seed).normal(size=24)
    estimate, rotated = decode_classes(logits), decode_classes(np.roll(logits, k))
    weights = np.exp(logits) / np.exp(logits).sum()
    mean = sum(w * np.exp(2j * np.pi * c / 24) for c, w in enumerate(weights))
    assert circular_distance_deg(rotated, estimate + 15 * k) < 1e-6
    assert circular_distance_deg(estimate, np.degrees(np.angle(mean))) < 1e-6


def test_an_estimator_comes_back_from_its_file_with_its_history(tmp_path):
    faces = clock_faces(3, 24)
    trained = train_estimator(named(faces), ["a", "c"], SETTINGS | {"epochs": 1}, CPU, 0)
    save_estimator(tmp_path / "estimator.safetensors", trained, CPU)
    read = load_estimator(tmp_path / "estimator.safetensors", CPU)
    assert list(read.trained_on) == ["a", "c"]
    assert read.image_side == 16
    np.testing.assert_array_equal(*(network_outputs(e, faces, CPU) for e in (trained, read)))


def test_objects_that_were_trained_on_are_refused():
    estimators = [untrained(seen=("a", "b")), untrained(seen=("c",))]
    with pytest.raises(UserError, match="'c' is a training object"):
        outputs_of_parts(estimators, named(clock_faces(3, 8)), [["c"], ["b", "c"]], CPU)


@pytest.mark.parametrize(
    "wrong", [{"learning_rate": 1e30}, {"weight_decay": 1e38}, {"learning_rate": float("inf")}]
)
def test_a_training_that_diverges_stops_and_names_the_setting(wrong):
    key = next(iter(wrong))
    with pytest.raises(UserError, match=rf"not finite in epoch 1: lower .*{key}="):
        train_network(clock_faces(3), SETTINGS | {"epochs": 2} | wrong, CPU, 0)


def test_outputs_that_are_not_finite_are_refused():
    estimator = untrained()
    torch.nn.init.constant_(next(iter(estimator.network.parameters())), float("nan"))
    with pytest.raises(UserError, match="outputs are not finite"):
        network_outputs(estimator, clock_faces(1, 8), CPU)


def test_a_damaged_estimator_is_named(tmp_path):
    path = tmp_path / "estimator.safetensors"
    save_estimator(path, untrained(), CPU)
    whole = path.read_bytes()
    for content in (b"", whole[:100], whole[:-1], b"\xff" * 64, whole.replace(b"nbv", b"xyz")):
        path.write_bytes(content)
        with pytest.raises(
            UserError, match=r"estimator\.safetensors: .*run the same command again"
        ):
            load_estimator(path, CPU)


def test_images_of_another_size_are_refused():
    with pytest.raises(UserError, match="32 pixels a side"):
        network_outputs(untrained(), clock_faces(1, 8, side=32), CPU)


def test_every_depth_code_is_exact_in_bfloat16():
    codes = np.arange(256, dtype=np.uint8).reshape(1, 16, 16)
    half = to_input(codes, hw.Hardware(torch.device("cpu"), torch.bfloat16))
    np.testing.assert_array_equal(half.float().numpy().ravel(), np.arange(256) / 128)


def test_targets_of_a_regressor_are_unit_vectors():
    targets = direction_targets(SETTINGS, 4)
    np.testing.assert_allclose(targets, [[1, 0], [0, 1], [-1, 0], [0, -1]], atol=1e-7)


@given(st.sampled_from([8, 24, 72]), st.floats(2, 60))
def test_targets_of_a_classifier_are_circular_and_centred_on_the_azimuth(n_classes, bandwidth):
    settings = {"n_classes": n_classes, "target_bandwidth_deg": bandwidth}
    targets = class_targets(settings, 360).astype(np.float64)
    np.testing.assert_allclose(targets.sum(axis=1), 1, atol=1e-6)
    rotated = np.roll(targets, (360 // n_classes, 1), axis=(0, 1))
    np.testing.assert_allclose(rotated, targets, atol=1e-6)
    centres = np.arange(n_classes) * 360 / n_classes
    for view in (0, 1, 100, 359):
        apart = circular_distance_deg(centres, view)
        by_distance = targets[view][np.argsort(apart)]
        assert (np.diff(by_distance) <= 1e-7).all()


@pytest.mark.parametrize("side", [8, 15, 33, 64])
def test_any_image_side_fits_the_network(side):
    images = torch.zeros(2, 1, side, side)
    assert build_network(SETTINGS, side)(images).shape == (2, 2)
    assert build_network(CLASSES, side)(images).shape == (2, 24)


def test_bfloat16_and_float32_answer_alike():
    faces = clock_faces(8)
    trained = train_estimator(named(faces), NAMES[:7], SETTINGS, CPU, 0)
    full = azimuth_of(trained, faces[7:], CPU)
    half = azimuth_of(trained, faces[7:], hw.Hardware(torch.device("cpu"), torch.bfloat16))
    assert np.median(circular_distance_deg(full, half)) < 1.0


def test_a_device_that_is_not_there_is_refused():
    if torch.cuda.is_available():
        pytest.skip("this machine has CUDA")
    with pytest.raises(UserError, match="device=cuda: not available"):
        hw.choose_hardware("cuda")


@pytest.mark.parametrize(
    ("cuda", "mps", "device"),
    [(True, True, "cuda"), (False, True, "mps"), (False, False, "cpu")],
)
def test_auto_takes_the_first_device_that_is_there(monkeypatch, cuda, mps, device):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: cuda)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: mps)
    assert str(hw.choose_hardware("auto", "float32")) == f"{device}, float32"


@pytest.mark.parametrize("native", [True, False])
def test_bfloat16_is_taken_where_the_device_has_it(monkeypatch, native):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda **_: native)
    taken = "bfloat16" if native else "float32"
    assert str(hw.choose_hardware("cuda")) == f"cuda, {taken}"
    assert hw.choose_hardware("cuda", "bfloat16").dtype == torch.bfloat16


def test_the_processors_own_precision_is_one_of_two_and_mps_computes_in_float32(monkeypatch):
    assert hw.choose_hardware("cpu").dtype in (torch.bfloat16, torch.float32)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: True)
    assert hw.choose_hardware("mps").dtype == torch.float32

"""A bundle's network: an ONNX model with the outputs of the trained network, and stable bytes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from made_bundles import SIDE, random_codes, random_estimator, settings
from nbv.bundles.network import Sweep, find_mirror_plane, open_network, open_session
from nbv.core.circle.angles import circular_distance_deg, mirrored_bins
from nbv.core.circle.logits import from_logits
from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth
from nbv.data.depth_images import DepthImages
from nbv.data.meshes import normalise
from nbv.data.procedural import generate
from nbv.data.render import open_renderer
from nbv.errors import BundleError, UserError
from nbv.experiment.estimation.hardware import choose_hardware
from nbv.experiment.estimation.inference import network_outputs
from nbv.experiment.estimation.make_bundle import bundled_model, bundled_network, sweeps_of
from nbv.experiment.estimation.outputs import decode_classes
from nbv.experiment.estimation.weights import Estimator, save_estimator

KINDS = {
    "small": (settings(), SIDE),
    # As in config/estimator/classifier.yaml, with few channels.
    "five layers": (settings(120, (4, 6, 8, 10, 12), 32), 64),
    "one layer": (settings(36, (5,), 16), 24),
    "odd side": (settings(24, (4, 6, 8), 16), 45),
}
PLANES = (None, 0.0, 90.0)
CPU = choose_hardware("cpu", "float32")


def estimator_of(kind: str, *, is_rounded: bool = True) -> Estimator:
    """With kernels and matrices in half precision, as a bundle has them."""
    # Logits of a small range: what single precision rounds grows with them.
    estimator = random_estimator(*KINDS[kind], sharpness=0.7)
    if is_rounded:
        for values in estimator.network.parameters():
            if values.ndim > 1:
                values.data = values.data.half().float()
    return estimator


def averaged_by_torch(estimator: Estimator, codes: np.ndarray, plane_deg: float | None):
    """The trained network's logits, and the mean with its mirror image where there is a plane."""
    own = network_outputs(estimator, codes, CPU)
    if plane_deg is None:
        return own
    n = own.shape[1]
    other = network_outputs(estimator, codes[:, :, ::-1], CPU)
    # Class c is seen from 360 c / n degrees, and its mirror image from twice the plane less that.
    return (own + other[:, [round(plane_deg * n / 180 - c) % n for c in range(n)]]) / 2


def test_batch_norms_of_the_fixture_are_not_the_identity():
    """Else the tests below would not notice where they are left out."""
    state = estimator_of("small").network.state_dict()
    assert state["0.3.running_mean"].abs().max() > 0.01
    assert (state["0.3.running_var"] - 1).abs().max() > 0.1
    assert (state["0.3.weight"] - 1).abs().max() > 0.1


@pytest.mark.parametrize("plane_deg", PLANES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_logits_are_those_of_torch(kind, plane_deg, rng):
    estimator = estimator_of(kind)
    codes = random_codes(rng, 50, estimator.image_side)
    logits = bundled_network(estimator, plane_deg)(codes)
    wanted = averaged_by_torch(estimator, codes, plane_deg)
    assert logits.dtype == np.float32
    assert np.ptp(wanted) > 1
    assert np.abs(logits - wanted).max() < 1e-4
    apart = circular_distance_deg(decode_classes(logits.astype(float)), decode_classes(wanted))
    # A random distribution has hardly a direction: what counts is the error of its moment.
    angles = 2 * np.pi * np.arange(wanted.shape[1]) / wanted.shape[1]
    length = np.abs(from_logits(wanted, 1.0) @ np.exp(1j * angles))
    assert (apart * length).max() < 0.001


@pytest.mark.parametrize("plane_deg", PLANES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_second_output_is_the_hidden_layer_of_the_crop(kind, plane_deg, rng):
    estimator = estimator_of(kind)
    codes = random_codes(rng, 20, estimator.image_side)[:, None].astype(np.float32)
    (hidden,) = open_session(bundled_model(estimator, plane_deg)).run(["hidden"], {"codes": codes})
    with torch.inference_mode():
        wanted = estimator.network[:-1](torch.from_numpy(codes) / 128).numpy()
    assert hidden.shape == (20, estimator.settings["hidden"])
    assert (wanted == 0).any()
    assert hidden == pytest.approx(wanted, abs=1e-4)


@pytest.mark.slow
def test_the_same_weights_give_the_same_bytes_in_any_folder_and_process(tmp_path):
    estimator = estimator_of("small", is_rounded=False)
    script = (
        "import sys; from nbv.experiment.estimation.make_bundle import bundled_model\n"
        "from nbv.experiment.estimation.hardware import choose_hardware\n"
        "from nbv.experiment.estimation.weights import load_estimator\n"
        "estimator = load_estimator('e.safetensors', choose_hardware('cpu', 'float32'))\n"
        f"for plane_deg in {PLANES}:\n"
        "    open(f'{plane_deg}.onnx', 'wb').write(bundled_model(estimator, plane_deg))\n"
    )
    folder = tmp_path / "another folder"
    folder.mkdir()
    save_estimator(folder / "e.safetensors", estimator, CPU)
    subprocess.run([sys.executable, "-c", script], check=True, cwd=folder)
    for plane_deg in PLANES:
        found = (folder / f"{plane_deg}.onnx").read_bytes()
        assert found == bundled_model(estimator, plane_deg)
        assert str(Path(__file__).parents[2]).encode() not in found


def test_an_export_leaves_the_estimator_as_it_was():
    estimator = estimator_of("small", is_rounded=False)
    before = {name: values.clone() for name, values in estimator.network.state_dict().items()}
    bundled_model(estimator)
    after = estimator.network.state_dict()
    assert list(after) == list(before)
    assert all(torch.equal(after[name], values) for name, values in before.items())


@pytest.mark.parametrize("plane_deg", PLANES)
def test_the_model_is_sound_and_half_the_size_of_the_weights(plane_deg):
    import onnx

    estimator = random_estimator(settings(hidden=400))
    model = bundled_model(estimator, plane_deg)
    onnx.checker.check_model(onnx.load_from_string(model), full_check=True)
    n_bytes = sum(4 * values.numel() for values in estimator.network.parameters())
    assert n_bytes / 2 < len(model) < n_bytes / 2 + 20_000


@pytest.mark.parametrize("plane_deg", PLANES)
def test_an_image_does_not_depend_on_those_next_to_it(rng, plane_deg):
    network = bundled_network(estimator_of("five layers"), plane_deg)
    codes = random_codes(rng, 7, 64)
    logits = network(codes)
    assert logits.shape == (7, 120)
    for place in (0, 3, 6):
        one = network(codes[place : place + 1])
        assert one[0] == pytest.approx(logits[place], abs=1e-4)
    # Codes are a whole batch in any memory order.
    assert network(codes[::-1])[::-1] == pytest.approx(logits, abs=1e-4)


def test_calibration_sees_the_weights_that_a_bundle_keeps(rng):
    estimator = estimator_of("small", is_rounded=False)
    codes = random_codes(rng, 12)
    ((sweep,), _, _) = sweeps_of(
        bundled_network(estimator), [DepthImages(("a",), codes[None])], [0.0], ["a"]
    )
    rounded = averaged_by_torch(estimator_of("small"), codes, None)
    assert sweep.logits == pytest.approx(rounded, abs=1e-5)
    full = averaged_by_torch(estimator, codes, None)
    assert not np.allclose(sweep.logits, full, rtol=0, atol=1e-5)


@pytest.mark.parametrize("step", [1, 5, 7])
def test_a_step_leaves_views_out_of_a_turn_and_nothing_else(recommender, rng, step):
    images = DepthImages(("a", "b"), random_codes(rng, 70).reshape(2, 35, SIDE, SIDE))
    whole, *_ = sweeps_of(recommender.network, [images], [30.0], ["b", "a"])
    some, *_ = sweeps_of(recommender.network, [images], [30.0], ["b", "a"], step)
    for all_of_it, part in zip(whole, some, strict=True):
        assert part.object_id == all_of_it.object_id
        assert np.array_equal(part.azimuth_deg, all_of_it.azimuth_deg[::step])
        assert np.array_equal(part.codes, all_of_it.codes[::step])
        assert part.logits == pytest.approx(all_of_it.logits[::step], abs=1e-4)


def test_a_model_that_is_none_is_one_line(bundle):
    for model in (b"", b"no model", bundle.network[:-100], bundle.network[:100]):
        with pytest.raises(BundleError, match="the bundle's network cannot be run") as error:
            open_network(model, SIDE, bundle.n_bins)
        assert "\n" not in str(error.value)
        assert error.value.name == "damaged-bundle"


def test_a_model_of_other_crops_or_classes_is_one_line(bundle):
    for side, n_classes in ((SIDE + 1, bundle.n_bins), (SIDE, bundle.n_bins + 1)):
        with pytest.raises(BundleError, match="damaged-bundle: the bundle's network has"):
            open_network(bundle.network, side, n_classes)


def test_crops_of_another_shape_are_one_line(recommender):
    for shape in ((1, SIDE + 1, SIDE + 1), (1, SIDE, SIDE - 1), (SIDE, SIDE), (1, 1, SIDE, SIDE)):
        with pytest.raises(UserError, match=rf"give \(n, {SIDE}, {SIDE}\)"):
            recommender.network(np.zeros(shape, dtype=np.uint8))


CAMERA = Camera(image_side=32)
N_CLASSES = 60


@given(st.integers(1, 180), st.integers(0, 359))
def test_a_class_and_its_mirror_image_lie_on_both_sides_of_the_plane(n_classes, place):
    plane_deg = place % n_classes * 180 / n_classes
    mirrored = mirrored_bins(n_classes, plane_deg)
    assert np.array_equal(mirrored[mirrored], np.arange(n_classes))
    middle_deg = (np.arange(n_classes) + mirrored) * 180 / n_classes - plane_deg
    assert np.allclose(middle_deg / 180, np.rint(middle_deg / 180))


def images_of(mesh: trimesh.Trimesh, azimuth_deg) -> np.ndarray:
    depth = open_renderer("embree").render(mesh.vertices, mesh.faces, 30.0, azimuth_deg, CAMERA)
    return encode_depth(depth, CAMERA)


def network_of_templates(mesh: trimesh.Trimesh, seed: int = 0):
    """A network: how like an image is to noisy images of a mesh, one for each class."""
    templates = images_of(mesh, np.arange(N_CLASSES) * (360 / N_CLASSES)).astype(np.float32)
    templates += np.random.default_rng(seed).normal(0, 60, templates.shape).astype(np.float32)
    flat = templates.reshape(N_CLASSES, -1)

    def network(codes):
        rows = codes.reshape(len(codes), -1).astype(np.float32)
        apart = (rows**2).sum(axis=1)[:, None] - 2 * rows @ flat.T + (flat**2).sum(axis=1)
        return (-apart / 1e5).astype(np.float32)

    return network


def sweeps_of_meshes(network, meshes) -> list[Sweep]:
    azimuth_deg = np.arange(48) * 7.5
    codes = [images_of(mesh, azimuth_deg) for mesh in meshes]
    return [Sweep(str(i), "", 30.0, azimuth_deg, network(c), c) for i, c in enumerate(codes)]


def objects(category: str, n: int) -> list[trimesh.Trimesh]:
    return [normalise(generate(category, 1, i), "+z", "+x", 0.0, "origin") for i in range(n)]


def symmetry_plane_deg(mesh: trimesh.Trimesh) -> float:
    """The azimuth in which the camera sees a mesh that is its own mirror image, by its images."""
    views = np.arange(0, 180, 90.0)
    images = images_of(mesh, views).astype(float)
    return float(views[np.abs(images - images[:, :, ::-1]).sum(axis=(1, 2)).argmin()])


@pytest.mark.parametrize("category", ["mug", "chair", "car"])
def test_the_plane_of_a_category_is_found(category):
    (mesh,) = objects(category, 1)
    network = network_of_templates(mesh)
    found = find_mirror_plane(network, sweeps_of_meshes(network, [mesh]))
    assert found == symmetry_plane_deg(mesh)


def test_objects_that_are_not_their_own_mirror_image_have_no_plane():
    (mug,) = objects("mug", 1)
    lump = trimesh.creation.box((0.12, 0.3, 0.2))
    lump.apply_translation((0.15, 0.25, 0.1))
    both = trimesh.util.concatenate([mug, lump])
    network = network_of_templates(both)
    assert find_mirror_plane(network, sweeps_of_meshes(network, [both])) is None

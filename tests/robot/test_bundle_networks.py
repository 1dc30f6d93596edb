"""A bundle's network: the same outputs from numpy, from ONNX, and from the trained network."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from made_bundles import SIDE, made_bundle, random_codes, random_weights, settings
from nbv.core.angles import circular_distance_deg
from nbv.core.distributions import mean_direction_deg
from nbv.core.logits import from_logits
from nbv.data.camera import Camera
from nbv.data.depth_images import DepthImages
from nbv.data.meshes import as_mesh
from nbv.data.normalisation import normalise
from nbv.data.procedural import generate
from nbv.data.randomisation import Randomisation, randomised_turn
from nbv.data.renderers import open_renderer
from nbv.data.sensors import build_sensor
from nbv.errors import UserError
from nbv.experiment.config.compose import load_config
from nbv.experiment.estimation.hardware import choose_hardware
from nbv.experiment.estimation.inference import network_outputs
from nbv.experiment.estimation.networks import build_network, decode_classes
from nbv.experiment.estimation.weights import Estimator
from nbv.experiment.make_bundle import kept_network, turns_of
from nbv.robot.bundle import as_kept, load_bundle
from nbv.robot.folding import network_shapes
from nbv.robot.mirror import mirror_averaged
from nbv.robot.network import BACKENDS, open_network
from nbv.robot.recommender import bundle_path

KINDS = {
    "small": (settings(), SIDE),
    # As in config/estimator/classifier.yaml, with few channels.
    "five layers": (settings(120, (4, 6, 8, 10, 12), 32), 64),
    "one layer": (settings(36, (5,), 16), 24),
    "odd side": (settings(24, (4, 6, 8), 16), 45),
}


PLANES = (None, 0.0, 90.0)


def bundle_of(kind: str, seed: int = 0, plane_deg: float | None = None):
    estimator, side = KINDS[kind]
    # Logits of a small range: what single precision rounds grows with them.
    weights = random_weights(estimator, side, seed, sharpness=0.7)
    camera = Camera(image_side=side)
    return made_bundle(
        weights=weights, estimator=estimator, camera=camera, mirror_plane_deg=plane_deg
    )


def network_with(backend, bundle):
    if backend == "onnx":
        pytest.importorskip("onnx")
        pytest.importorskip("onnxruntime")
    return open_network(bundle, backend)


def torch_network(bundle):
    """The trained network itself, and the mean with its mirror image where there is a plane."""
    network = build_network(bundle.estimator, bundle.camera.image_side)
    state = {name: torch.from_numpy(array) for name, array in bundle.weights.items()}
    network.load_state_dict(state, strict=False)
    estimator = Estimator(network.eval(), bundle.estimator, bundle.camera.image_side, [])
    cpu = choose_hardware("cpu", "float32")
    return mirror_averaged(
        lambda codes: network_outputs(estimator, codes, cpu), bundle.mirror_plane_deg
    )


def test_batch_norms_of_the_fixture_are_not_the_identity(bundle):
    """Else the tests below would not notice where they are left out."""
    assert np.abs(bundle.weights["0.3.running_mean"]).max() > 0.01
    assert np.abs(bundle.weights["0.3.running_var"] - 1).max() > 0.1
    assert np.abs(bundle.weights["0.3.weight"] - 1).max() > 0.1


@pytest.mark.parametrize("plane_deg", PLANES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_the_outputs_are_those_of_torch(backend, kind, plane_deg, rng):
    bundle = bundle_of(kind, plane_deg=plane_deg)
    codes = random_codes(rng, 200, bundle.camera.image_side)
    logits = network_with(backend, bundle)(codes)
    wanted = torch_network(bundle)(codes)
    assert np.ptp(wanted) > 1
    assert np.abs(logits - wanted).max() < 1e-4
    apart = circular_distance_deg(
        decode_classes(logits.astype(float)), decode_classes(wanted.astype(float))
    )
    # A random distribution has hardly a direction: what counts is the error of its moment.
    angles = 2 * np.pi * np.arange(wanted.shape[1]) / wanted.shape[1]
    length = np.abs(from_logits(wanted, 1.0) @ np.exp(1j * angles))
    assert (apart * length).max() < 0.001


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_directions_are_those_of_torch(backend, rng):
    for seed in range(3):
        bundle = bundle_of("small", seed)
        codes = random_codes(rng, 200)
        directions = [
            mean_direction_deg(from_logits(network(codes), bundle.temperature))
            for network in (network_with(backend, bundle), torch_network(bundle))
        ]
        assert circular_distance_deg(*directions).max() < 0.01


@pytest.fixture(scope="module")
def thousand_crops():
    """Generated mugs, all round, at 0 to 60 degrees, with all that a camera does to them."""
    config = load_config(
        Path(__file__).parents[2] / "config",
        ["experiment=bundles", "estimator=classifier", "randomisation=camera", "sensor=kinect"],
    )
    sensor, camera = config["sensor"], load_bundle(bundle_path("mug")).camera
    renderer, crops = open_renderer("embree"), []
    for index in range(10):
        mug = as_mesh(normalise(generate("mug", 1, index), "+z", "+x", 0.0, "origin"))
        crops += [
            randomised_turn(
                mug,
                elevation,
                np.arange(20) * 18.0 + 1.8 * index,
                camera,
                renderer,
                build_sensor(sensor["name"], sensor["parameters"]),
                sensor["diagonal_m"]["mug"],
                Randomisation(**config["randomisation"]),
                np.random.default_rng([index, int(elevation)]),
            )
            for elevation in (0.0, 15.0, 30.0, 45.0, 60.0)
        ]
    return np.concatenate(crops)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_torch_agrees_on_a_thousand_crops_to_a_hundredth_of_a_degree(backend, thousand_crops):
    bundle = load_bundle(bundle_path("mug"))
    assert len(thousand_crops) == 1000
    found, wanted = (
        mean_direction_deg(from_logits(network(thousand_crops), bundle.temperature))
        for network in (network_with(backend, bundle), torch_network(bundle))
    )
    assert circular_distance_deg(found, wanted).max() <= 0.01
    # Not by saying the same of all.
    assert np.ptp(wanted) > 300


@pytest.mark.parametrize("kind", KINDS)
def test_the_shapes_of_weights_are_those_of_the_trained_network(kind):
    estimator, side = KINDS[kind]
    state = build_network(estimator, side).state_dict().items()
    wanted = {name: tuple(values.shape) for name, values in state if values.is_floating_point()}
    assert network_shapes(estimator, side) == wanted


def test_numpy_gives_each_image_the_same_bits_in_any_company(rng):
    bundle = bundle_of("five layers", plane_deg=90.0)
    network = open_network(bundle, "numpy")
    codes = random_codes(rng, 40, 64)
    logits = network(codes)
    assert network(codes[:0]).shape == (0, 120)
    for some in (slice(0, 1), slice(3, 22), slice(39, 40)):
        assert np.array_equal(network(codes[some]), logits[some])


@pytest.mark.parametrize("plane_deg", PLANES)
def test_the_graph_is_sound_and_has_no_batch_norm(plane_deg):
    onnx = pytest.importorskip("onnx")
    from nbv.robot.onnx_graph import onnx_model

    bundle = bundle_of("five layers", plane_deg=plane_deg)
    model = onnx_model(bundle)
    onnx.checker.check_model(model, full_check=True)
    kinds = [node.op_type for node in model.graph.node]
    assert kinds.count("Conv") == 5
    assert "BatchNormalization" not in kinds
    (codes,) = model.graph.input
    shape = [size.dim_param or size.dim_value for size in codes.type.tensor_type.shape.dim]
    assert shape == ["n", 1, 64, 64]
    assert [output.name for output in model.graph.output] == ["logits"]
    assert onnx_model(bundle).SerializeToString() == model.SerializeToString()


def test_the_graph_is_made_without_torch(bundle_file, tmp_path):
    pytest.importorskip("onnx")
    import subprocess

    script = (
        "import sys; sys.modules['torch'] = None\n"
        "from nbv.robot.bundle import load_bundle\n"
        "from nbv.robot.onnx_graph import onnx_model\n"
        f"onnx_model(load_bundle({str(bundle_file)!r}))\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize("plane_deg", PLANES[1:])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirror_image_has_the_logits_backwards(rng, backend, plane_deg):
    bundle = bundle_of("odd side", plane_deg=plane_deg)
    network = network_with(backend, bundle)
    codes = random_codes(rng, 20, 45)
    logits, mirrored = network(codes), network(codes[:, :, ::-1])
    # Class c is seen from 15 c degrees, and its mirror image from twice the plane less that.
    wanted = [round((2 * plane_deg - 15 * c) / 15) % 24 for c in range(24)]
    assert mirrored == pytest.approx(logits[:, wanted], abs=1e-4)
    plain = torch_network(replace(bundle, mirror_plane_deg=None))
    mean = (plain(codes) + plain(codes[:, :, ::-1])[:, wanted]) / 2
    assert logits == pytest.approx(mean, abs=1e-4)


@pytest.mark.parametrize("plane_deg", PLANES)
@pytest.mark.parametrize("backend", BACKENDS)
def test_an_image_does_not_depend_on_those_next_to_it(bundle, rng, backend, plane_deg):
    bundle = replace(bundle, mirror_plane_deg=plane_deg)
    network = network_with(backend, bundle)
    codes = random_codes(rng, 7)
    logits = network(codes)
    assert logits.shape == (7, 24)
    assert logits.dtype == np.float32
    for place in (0, 3, 6):
        one = network(codes[place : place + 1])
        assert one[0] == pytest.approx(logits[place], abs=1e-4)
    # Codes are a whole batch in any memory order.
    assert network(codes[::-1])[::-1] == pytest.approx(logits, abs=1e-4)


def test_calibration_sees_the_weights_that_a_bundle_keeps(rng):
    weights = random_weights(settings())
    network = build_network(settings(), SIDE)
    network.load_state_dict({n: torch.from_numpy(a) for n, a in weights.items()}, strict=False)
    estimator = Estimator(network.eval(), settings(), SIDE, [])
    images = DepthImages(("a",), random_codes(rng, 12)[None])
    ((turn,), _, _) = turns_of(kept_network(estimator), [images], [0.0], ["a"])
    kept = open_network(made_bundle(weights=as_kept(weights)), "numpy")(images.codes[0])
    assert np.array_equal(turn.logits, kept)
    full = network_outputs(estimator, images.codes[0], choose_hardware("cpu", "float32"))
    assert not np.allclose(turn.logits, full, rtol=0, atol=1e-5)


@pytest.mark.parametrize("step", [1, 5, 7])
def test_a_step_leaves_views_out_of_a_turn_and_nothing_else(bundle, rng, step):
    images = DepthImages(("a", "b"), random_codes(rng, 70).reshape(2, 35, SIDE, SIDE))
    network = network_with("numpy", bundle)
    whole, *_ = turns_of(network, [images], [30.0], ["b", "a"])
    some, *_ = turns_of(network, [images], [30.0], ["b", "a"], step)
    for all_of_it, part in zip(whole, some, strict=True):
        assert part.object_id == all_of_it.object_id
        assert np.array_equal(part.azimuth_deg, all_of_it.azimuth_deg[::step])
        assert np.array_equal(part.codes, all_of_it.codes[::step])
        assert part.logits == pytest.approx(all_of_it.logits[::step], abs=1e-4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_background_is_0_and_the_reference_is_1(bundle, backend):
    """An image of one code is a constant input: 0, 1 and 255 / 128."""
    network = network_with(backend, bundle)
    own = build_network(bundle.estimator, SIDE)
    own.load_state_dict({n: torch.from_numpy(a) for n, a in bundle.weights.items()})
    for code, value in ((0, 0.0), (128, 1.0), (255, 255 / 128)):
        with torch.inference_mode():
            wanted = own.eval()(torch.full((1, 1, SIDE, SIDE), value)).numpy()
        found = network(np.full((1, SIDE, SIDE), code, dtype=np.uint8))
        assert found == pytest.approx(wanted, abs=1e-4)


def test_weights_that_do_not_fit_are_one_line(bundle):
    for backend in BACKENDS:
        for name, shape in (("2.weight", (40, 9)), ("4.bias", (1,)), ("9.weight", (2, 2))):
            weights = {**bundle.weights, name: np.ones(shape, dtype=np.float32)}
            with pytest.raises(UserError, match="do not fit"):
                open_network(replace(bundle, weights=weights), backend)


@pytest.mark.parametrize("backend", BACKENDS)
def test_crops_of_another_shape_are_one_line(bundle, backend):
    network = network_with(backend, bundle)
    for shape in ((1, SIDE + 1, SIDE + 1), (1, SIDE, SIDE - 1), (SIDE, SIDE), (1, 1, SIDE, SIDE)):
        with pytest.raises(UserError, match=rf"give \(n, {SIDE}, {SIDE}\)"):
            network(np.zeros(shape, dtype=np.uint8))


def test_an_unknown_backend_is_one_line(bundle):
    with pytest.raises(UserError, match="did you mean 'onnx'"):
        open_network(bundle, "onyx")
    with pytest.raises(UserError, match="choose from: numpy, onnx"):
        open_network(bundle, "gpu")


@pytest.mark.parametrize("missing", ["onnx", "onnxruntime"])
def test_without_its_packages_onnx_is_one_line_and_numpy_the_default(
    bundle, rng, monkeypatch, missing
):
    other = {"onnx": "onnxruntime", "onnxruntime": "onnx"}[missing]
    pytest.importorskip(other)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(UserError, match=r"nbv\[onnx\]"):
        open_network(bundle, "onnx")
    codes = random_codes(rng, 2)
    found = open_network(bundle)(codes)
    assert np.array_equal(found, open_network(bundle, "numpy")(codes))


def test_onnx_is_the_default_where_it_is_installed(bundle, rng):
    codes = random_codes(rng, 2)
    wanted = network_with("onnx", bundle)(codes)
    assert np.array_equal(open_network(bundle)(codes), wanted)

"""What a run is estimated to need is what it really allocates, and too much is refused."""

from __future__ import annotations

import copy
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import torch

from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth
from nbv.data.procedural import generate
from nbv.data.renderers import open_renderer
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.config.memory import (
    LARGEST_NODE_BYTES,
    available_bytes,
    check_memory,
    n_parameters,
    needs,
    training_objects,
)
from nbv.experiment.estimation.hardware import choose_hardware, to_input
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.splits import make_splits, objects_with_role
from nbv.experiment.statistics.metrics import resample_objects, resampled_medians

CONFIG = Path(__file__).parents[2] / "config"
GIB = 2**30
PAPER = load_config(CONFIG)
CLASSIFIER = load_config(CONFIG, ["estimator=classifier", "calibration=crossfit"])


def changed(settings, **values):
    """Return settings with some dotted keys changed; __ stands for the dot."""
    new = copy.deepcopy(dict(settings))
    for key, value in values.items():
        *above, last = key.split("__")
        section = new
        for part in above:
            section = section[part]
        section[last] = value
    return new


def part(settings, n_objects, job, first_key):
    found = [n for n in needs(settings, n_objects) if n.job == job and n.keys[0] == first_key]
    assert len(found) == 1
    return found[0].n_bytes


@pytest.mark.parametrize("experiment", ["paper", "quick"])
@pytest.mark.parametrize("estimator", ["regressor", "classifier"])
@pytest.mark.parametrize("calibration", ["holdout", "crossfit"])
def test_what_the_project_runs_fits_into_a_small_machine(experiment, estimator, calibration):
    chosen = (f"experiment={experiment}", f"estimator={estimator}", f"calibration={calibration}")
    settings = load_config(CONFIG, [*chosen, "estimator.precision=float32", "estimator.epochs=40"])
    check_memory(settings, settings["n_objects"], 2 * GIB)


@pytest.mark.parametrize(
    ("values", "n_objects", "message"),
    [
        ({"camera__image_side": 100_000}, 0, "camera.image_side=100000: rendering needs at least"),
        ({"n_resamples": 10**12}, 125, "n_resamples=1000000000000, n_objects=125: resampling"),
        ({"estimator__hidden": 10**9}, 125, "estimator.hidden=1000000000, estimator.channels=["),
        ({"estimator__channels": [16, 10**6]}, 125, "estimator.channels=[16, 1000000], camera."),
        ({"estimator__batch_size": 10**9}, 10**4, "needs at least"),
        ({"n_objects": 10**9}, 10**9, "n_objects=1000000000, camera.image_side=64: training"),
    ],
)
def test_what_no_machine_has_is_refused_with_its_key(values, n_objects, message):
    with pytest.raises(UserError) as caught:
        check_memory(changed(PAPER, **values), n_objects, 64 * GIB)
    assert message in str(caught.value)
    assert ", and there are 64 GiB; lower " in str(caught.value)


def test_a_large_batch_is_refused():
    settings = changed(PAPER, estimator__batch_size=10**9, estimator__channels=[512, 512])
    with pytest.raises(UserError, match=r"estimator\.batch_size=1000000000, estimator\.channels="):
        check_memory(settings, 125, 8 * GIB)


def test_the_largest_settings_are_only_a_line():
    """No sum overflows, however large what the schema admits."""
    large = {"estimator__hidden": 10**12, "estimator__channels": [10**12] * 100}
    large |= {"n_resamples": 10**12, "estimator__batch_size": 10**12}
    with pytest.raises(UserError, match="EiB of memory"):
        check_memory(changed(PAPER, **large), 10**12, LARGEST_NODE_BYTES)


def test_an_accelerator_holds_what_trains_there():
    settings = changed(PAPER, estimator__hidden=10**6)
    with pytest.raises(UserError, match=r"estimator\.hidden=1000000"):
        check_memory(settings, 125, GIB)
    check_memory(changed(settings, estimator__device="cuda"), 125, GIB)


def test_memory_is_that_of_this_machine_where_jobs_run_here():
    pages = Path("/proc/meminfo").read_text().split()[1]
    assert available_bytes(is_local=True) == pytest.approx(int(pages) * 1024, rel=0.01)
    assert available_bytes(is_local=False) == LARGEST_NODE_BYTES


@pytest.mark.parametrize("settings", [PAPER, CLASSIFIER], ids=["regressor", "classifier"])
@pytest.mark.parametrize(("side", "channels"), [(64, [16, 32, 48]), (17, [3]), (8, [4, 5, 6, 7])])
def test_the_number_of_parameters_is_that_of_the_network(settings, side, channels):
    estimator = settings["estimator"] | {"channels": channels}
    network = build_network(estimator, side)
    assert n_parameters(estimator, side) == sum(p.numel() for p in network.parameters())


@pytest.mark.parametrize("precision", ["bfloat16", "float32"])
def test_a_training_step_keeps_what_is_estimated(precision):
    """The tensors kept for the gradient; parameters, gradients and moments; the images."""
    settings = changed(PAPER, estimator__precision=precision, estimator__device="cpu")
    estimator, side, batch = settings["estimator"], 64, settings["estimator"]["batch_size"]
    hardware = choose_hardware("cpu", precision)
    codes = np.zeros((2, batch // 2, side, side), dtype=np.uint8)
    network, images = build_network(estimator, side), to_input(codes, hardware)
    optimiser = torch.optim.AdamW(network.parameters())
    parameters = {p.data_ptr() for p in network.parameters()}
    kept = {}

    def keep(tensor):
        storage = tensor.untyped_storage()
        if storage.data_ptr() not in parameters and tensor.shape[:1] == (batch,):
            kept[storage.data_ptr()] = storage.nbytes()
        return tensor

    with torch.autograd.graph.saved_tensors_hooks(keep, lambda tensor: tensor):
        with hardware.autocast():
            loss = network(images).float().square().mean()
        found = sum(kept.values()) - images.nbytes
    loss.backward()
    optimiser.step()
    state = [t for values in optimiser.state.values() for t in values.values()]
    held = [*network.parameters(), *(p.grad for p in network.parameters()), *state]
    network_bytes = sum(tensor.nbytes for tensor in held)

    activations = part(settings, 125, "training", "estimator.batch_size")
    assert 0.7 * found <= activations <= 1.05 * found
    weights = part(settings, 125, "training", "estimator.hidden")
    assert weights == pytest.approx(network_bytes, rel=0.01)
    per_image = (codes.nbytes + images.nbytes) / batch
    n_images = 360 * training_objects(settings, 125)
    assert part(settings, 125, "training", "n_objects") == n_images * per_image


@pytest.mark.parametrize(
    ("n_objects", "n_folds", "fraction"), [(125, 5, 0.2), (20, 3, 0.3), (7, 2, 0.9), (3, 3, 0.01)]
)
@pytest.mark.parametrize("parts", [None, 2])
def test_training_objects_are_those_of_the_splits(n_objects, n_folds, fraction, parts):
    ids = [str(index) for index in range(n_objects)]
    splits = make_splits(ids, n_folds, fraction, np.random.default_rng(0), parts)
    roles = ("train",) if parts is None else ("part1", "part2")
    largest = max(len(objects_with_role(splits, fold, *roles)) for fold in range(1, n_folds + 1))
    settings = {"n_folds": n_folds, "calibration_fraction": fraction}
    settings["calibration"] = "holdout" if parts is None else "crossfit"
    assert training_objects(settings, n_objects) == largest


def peak_bytes(function):
    tracemalloc.start()
    try:
        function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_rendering_keeps_what_is_estimated():
    mesh, camera = generate("mug", 0, 0), Camera(image_side=64)
    vertices = mesh.vertices / np.linalg.norm(mesh.extents)
    vertices -= (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    renderer = open_renderer("embree")

    def render():
        depth = renderer.render(vertices, mesh.faces, 0.0, np.arange(360.0), camera)
        encode_depth(depth, camera)

    render()
    estimated = part(changed(PAPER, camera__image_side=64), 1, "rendering", "camera.image_side")
    assert 0.4 * peak_bytes(render) <= estimated <= peak_bytes(render)


@pytest.mark.parametrize(("n_objects", "n_resamples"), [(20, 5000), (2000, 2000)])
def test_resampling_keeps_what_is_estimated(n_objects, n_resamples):
    objects = np.repeat(np.arange(n_objects), 3)
    values = np.random.default_rng(1).random(objects.size)

    def resample():
        drawn = resample_objects(n_objects, np.random.default_rng(0), n_resamples)
        resampled_medians(values, objects, drawn)

    settings = changed(PAPER, n_resamples=n_resamples)
    estimated = part(settings, n_objects, "resampling", "n_resamples")
    assert 0.5 * peak_bytes(resample) <= estimated <= 1.02 * peak_bytes(resample)

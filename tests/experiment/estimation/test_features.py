"""The depth features that ship: their network, and that no experiment's objects made them."""

import hashlib

import numpy as np
import pytest
import torch

from clock_faces import CPU, SETTINGS, clock_faces
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.seeds import FIRST_FEATURE_SEED
from nbv.data.depth_images import DepthImages
from nbv.data.procedural import CATEGORIES, generate
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.estimation.features import BATCH, SHIPPED, Features
from nbv.experiment.estimation.features_network import save_features, train_features
from nbv.experiment.estimation.hardware import to_input
from nbv.experiment.estimation.outputs import decode_directions
from projects import ROOT


@pytest.fixture(scope="module")
def shipped() -> Features:
    return Features.load()


@pytest.fixture(scope="module")
def trained():
    images = DepthImages(("a", "b"), clock_faces(2))
    # A hand that points to a points to 180 - a in the mirror.
    planes = {"mug": 90.0, "car": 90.0}
    return train_features([images, images], ["mug", "car"], planes, SETTINGS, CPU, 0)


def test_the_file_is_small_and_says_what_it_was_trained_on(shipped):
    assert SHIPPED.stat().st_size <= 3_000_000
    settings = shipped.provenance["settings"]
    assert settings["seed"] >= FIRST_FEATURE_SEED
    assert set(settings["categories"]) == set(CATEGORIES)
    assert len(settings["elevations_deg"]["mug"]) == 6


@pytest.mark.parametrize("overrides", [(), ("experiment=quick",), ("experiment=bundles",)])
def test_a_run_with_a_seed_of_the_features_is_refused(overrides):
    load_config(ROOT / "config", [*overrides, f"seed={FIRST_FEATURE_SEED - 1}"])
    with pytest.raises(UserError, match=f"seed={FIRST_FEATURE_SEED}: the depth features have seen"):
        load_config(ROOT / "config", [*overrides, f"seed={FIRST_FEATURE_SEED}"])


def test_features_are_never_trained_on_features():
    load_config(ROOT / "config", ["experiment=features"])
    with pytest.raises(UserError, match="have seen objects"):
        load_config(ROOT / "config", ["experiment=features", "estimator=linear"])


@pytest.mark.slow
def test_no_object_of_an_experiment_has_the_shape_of_one_of_the_features(shipped):
    def shapes(seed, n_objects):
        return {
            hashlib.sha256(np.round(generate(category, seed, k).vertices, 6).tobytes()).digest()
            for category in CATEGORIES
            for k in range(n_objects)
        }

    # The first of each category: an object depends on the seed and its number, not on the others.
    experiment = load_config(ROOT / "config")
    n_objects = experiment["n_objects"]
    own = shapes(shipped.provenance["settings"]["seed"], n_objects)
    assert len(own) == len(CATEGORIES) * n_objects
    assert not own & shapes(experiment["seed"], n_objects)


def test_each_image_has_its_own_features_whatever_the_batch(shipped):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 256, (BATCH + 3, 64, 64), dtype=np.uint8)
    together = shipped.of(codes)
    assert together.shape == (BATCH + 3, shipped.n_features)
    alone = np.concatenate([shipped.of(codes[k : k + 1]) for k in (0, BATCH, BATCH + 2)])
    np.testing.assert_allclose(together[[0, BATCH, BATCH + 2]], alone, atol=1e-4)


def test_a_mirror_image_has_the_same_even_part_and_the_other_odd_part(shipped):
    codes = np.random.default_rng(0).integers(0, 256, (3, 64, 64), dtype=np.uint8)
    even, odd = np.split(shipped.of_both(codes), 2, axis=1)
    mirrored_even, mirrored_odd = np.split(shipped.of_both(codes[..., ::-1]), 2, axis=1)
    np.testing.assert_array_equal(even, mirrored_even)
    np.testing.assert_array_equal(odd, -mirrored_odd)
    np.testing.assert_allclose(even + odd, shipped.of(codes), atol=1e-6)


def test_images_of_another_size_are_refused(shipped):
    with pytest.raises(UserError, match=r"camera\.image_side=32: .* give 64"):
        shipped.of(np.zeros((1, 32, 32), dtype=np.uint8))


def test_a_file_holds_the_hidden_layer_of_the_network_that_was_trained(trained, tmp_path):
    save_features(str(tmp_path / "f.safetensors"), trained, {"seed": 1})
    features = Features.load(tmp_path / "f.safetensors")
    assert (features.n_features, features.image_side) == (32, 16)
    assert features.provenance["seed"] == 1
    codes = clock_faces(1)[0, :9]
    with torch.inference_mode():
        hidden = trained.network[:-1](to_input(codes, CPU)).numpy()
    np.testing.assert_allclose(features.of(codes), hidden, atol=5e-3)


def test_a_file_that_holds_no_features_is_named(tmp_path):
    path = tmp_path / "f.safetensors"
    path.write_bytes(SHIPPED.read_bytes()[:1000])
    with pytest.raises(UserError, match=r"f\.safetensors"):
        Features.load(path)


def test_each_category_learns_by_outputs_of_its_own(trained):
    codes = clock_faces(1, seed=1)[0]
    with torch.inference_mode():
        outputs = trained.network(to_input(codes, CPU)).numpy().astype(np.float64)
    azimuth_deg = np.arange(72) * 5.0
    for of_category in (outputs[:, :2], outputs[:, 2:]):
        error_deg = circular_distance_deg(decode_directions(of_category), azimuth_deg)
        assert np.median(error_deg) < 15

"""From images to estimates of the objects that a fold's estimator has not seen."""

import numpy as np
import pandas as pd
import pytest
import torch

from nbv.core.circle.logits import fit_temperature
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.inference import estimate_fold, network_outputs
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.outputs import decode_classes, decode_directions
from nbv.experiment.estimation.weights import Estimator


def azimuth_of(estimator, codes, hardware):
    return decode_directions(network_outputs(estimator, codes, hardware))


CPU = Hardware(torch.device("cpu"), torch.float32)
NETWORK = {"kind": "regressor", "channels": [4, 8], "hidden": 8}
CLASSES = NETWORK | {"kind": "classifier", "n_classes": 12, "target_bandwidth_deg": 20}
NAMES = ("a", "b", "c", "d", "e")


def splits(*roles: str) -> pd.DataFrame:
    return pd.DataFrame({"object_id": NAMES, "fold": 1, "role": roles})


def estimator(seen: tuple[str, ...], settings=NETWORK, seed: int = 0) -> Estimator:
    torch.manual_seed(seed)
    return Estimator(build_network(settings, 16).eval(), settings, 16, seen)


@pytest.fixture
def images(rng) -> DepthImages:
    codes = rng.integers(0, 256, (len(NAMES), 24, 16, 16)).astype(np.uint8)
    return DepthImages(NAMES, codes)


def test_objects_are_calibrated_and_tested_by_the_estimator_that_saw_neither(images):
    tested = estimator(("b", "d"))
    roles = splits("test", "train", "calibration", "train", "calibration")
    found = estimate_fold(images, roles, 1, tested, [], CPU, distributions=False)
    for role, names in {"calibration": ("c", "e"), "test": ("a",)}.items():
        estimates, posteriors = found[role]
        assert estimates.object_ids == names
        assert posteriors is None
        expected = azimuth_of(tested, images.of(names), CPU)
        np.testing.assert_allclose(estimates.estimate_deg, expected, atol=1e-3)


def test_each_part_is_calibrated_by_the_estimator_of_the_others(images):
    tested, first, second = (
        estimator(seen, seed=seed) for seed, seen in enumerate(("bcde", "de", "bc"))
    )
    roles = splits("test", "part1", "part1", "part2", "part2")
    found = estimate_fold(images, roles, 1, tested, [first, second], CPU, distributions=False)
    calibration, _ = found["calibration"]
    assert calibration.object_ids == ("b", "c", "d", "e")
    by_part = [
        azimuth_of(first, images.of("bc"), CPU),
        azimuth_of(second, images.of("de"), CPU),
    ]
    np.testing.assert_allclose(calibration.estimate_deg, np.concatenate(by_part), atol=1e-3)


def test_calibration_objects_alone_choose_the_temperature_of_all(images):
    tested = estimator(("b", "d"), CLASSES)
    roles = splits("test", "train", "calibration", "train", "calibration")
    found = estimate_fold(images, roles, 1, tested, [], CPU, distributions=True)
    temperature = fit_temperature(
        network_outputs(tested, images.of("ce"), CPU), np.arange(24) * 15.0
    )
    for role, names in {"calibration": "ce", "test": "a"}.items():
        estimates, posteriors = found[role]
        assert posteriors is not None
        assert posteriors.temperature == pytest.approx(temperature, rel=1e-3)
        np.testing.assert_allclose(posteriors.distributions.sum(axis=-1), 1.0, atol=1e-6)
        expected = decode_classes(network_outputs(tested, images.of(names), CPU) / temperature)
        np.testing.assert_allclose(estimates.estimate_deg, expected, atol=0.05)

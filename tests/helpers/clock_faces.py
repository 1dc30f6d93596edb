"""Small estimators, and images of a clock's hand for them to learn from."""

import numpy as np
import torch

from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.weights import Estimator

SETTINGS = {
    "kind": "regressor",
    "channels": [8, 16],
    "hidden": 32,
    "epochs": 6,
    "batch_size": 32,
    "learning_rate": 3e-3,
    "weight_decay": 1e-2,
}
CLASSES = SETTINGS | {"kind": "classifier", "n_classes": 24, "target_bandwidth_deg": 10}
CPU = Hardware(torch.device("cpu"), torch.float32)


def untrained(settings=SETTINGS, side: int = 16, seen: tuple[str, ...] = ()) -> Estimator:
    return Estimator(build_network(settings, side).eval(), settings, side, seen)


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


NAMES = list("abcdefghijkl")


def named(faces):
    return DepthImages(tuple(NAMES[: len(faces)]), faces)

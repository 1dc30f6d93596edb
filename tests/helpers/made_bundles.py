"""A small bundle with random weights, and frames that it can see."""

from functools import cache
from pathlib import Path

import numpy as np
import torch
import yaml
from numpy.typing import NDArray

from nbv.bundles.bundle import Bundle, PaperTables
from nbv.bundles.network import Sweep
from nbv.bundles.ood import fit_ood
from nbv.core.circle.logits import from_logits
from nbv.core.circle.sweeps import bin_apart
from nbv.data.camera import Camera
from nbv.experiment.estimation.make_bundle import bundled_model
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.weights import Estimator

CONFIG = Path(__file__).parents[2] / "config"
BINS = 24
WIDTH = 360.0 / BINS
SIDE = 32
CAMERA = Camera(image_side=SIDE)
DIAGONAL_M = 0.12
FOCAL_PX = 150.0
ROWS, COLUMNS = 90, 120


def settings(n_classes: int = BINS, channels: tuple[int, ...] = (4, 6, 8), hidden: int = 40):
    stored = yaml.safe_load((CONFIG / "estimator" / "classifier.yaml").read_text())["estimator"]
    small = {"n_classes": n_classes, "channels": list(channels), "hidden": hidden}
    return {**stored, **small, "target_bandwidth_deg": 10}


def random_codes(rng: np.random.Generator, n: int, side: int = SIDE) -> NDArray[np.uint8]:
    """Crops of random blobs: some background, and codes around the reference depth."""
    codes = np.clip(rng.normal(128, 40, (n, side, side)), 1, 255).astype(np.uint8)
    down, across = np.mgrid[:side, :side] - (side - 1) / 2
    radius = rng.uniform(0.2, 0.5, (n, 2, 1, 1)) * side
    codes[(down / radius[:, 0]) ** 2 + (across / radius[:, 1]) ** 2 > 1] = 0
    return codes


def random_estimator(
    chosen: dict, side: int = SIDE, seed: int = 0, sharpness: float = 3.0
) -> Estimator:
    """Return a network that has seen random crops, so that its batch norms are not the identity."""
    torch.manual_seed(seed)
    network = build_network(chosen, side)
    rng = np.random.default_rng(seed)
    with torch.no_grad():
        for layer in network.modules():
            if isinstance(layer, torch.nn.BatchNorm2d):
                layer.weight.uniform_(0.5, 1.5)
                layer.bias.normal_(0, 0.3)
        network.train()
        for _ in range(4):
            network(torch.from_numpy(random_codes(rng, 16, side)[:, None] / np.float32(128)))
        # Random weights give nearly the same outputs for all images: take their mean off.
        network.eval()
        seen = network(torch.from_numpy(random_codes(rng, 64, side)[:, None] / np.float32(128)))
        network[-1].weight.mul_(sharpness / seen.std(dim=0).mean())
        network[-1].bias.zero_()
        seen = network(torch.from_numpy(random_codes(rng, 64, side)[:, None] / np.float32(128)))
        network[-1].bias.copy_(-seen.mean(dim=0))
    return Estimator(network, chosen, side, [])


@cache
def random_model(seed: int = 0, plane_deg: float | None = None) -> bytes:
    return bundled_model(random_estimator(settings(), seed=seed), plane_deg)


def sweep_logits(
    rng: np.random.Generator, n_sweeps: int, n_views: int = BINS, n_bins: int = BINS
) -> NDArray[np.float64]:
    """Logits (n_sweeps, n_views, n_bins) that are largest near the true azimuth, with noise."""
    truth = np.arange(n_views) * (360.0 / n_views)
    classes = np.arange(n_bins) * (360.0 / n_bins)
    aim = 4.0 * np.cos(np.radians(classes - truth[:, None]))
    # A blind range: there the network cannot tell.
    aim *= np.where(np.abs(truth - 90.0) < 50.0, 0.2, 1.0)[:, None]
    return aim + rng.normal(0, 0.8, (n_sweeps, n_views, n_bins))


def made_bundle(seed: int = 0, **changes) -> Bundle:
    rng = np.random.default_rng(seed)
    names = ("a", "b", "c")
    elevations = (0.0, 30.0)
    sweeps, rows = [], []
    azimuth_deg = np.arange(BINS) * WIDTH
    for name in names:
        for elevation in elevations:
            codes = random_codes(rng, BINS)
            logits = sweep_logits(rng, 1)[0]
            sweeps.append(Sweep(name, f"{elevation:g}", elevation, azimuth_deg, logits, codes))
            rows.append(bin_apart(azimuth_deg, from_logits(logits, 1.0)))
    values = {
        "category": "mug",
        "network": random_model(seed, changes.get("mirror_plane_deg")),
        "estimator": settings(),
        "camera": CAMERA,
        "diagonal_m": DIAGONAL_M,
        "extent_m": (0.4 * DIAGONAL_M, 1.6 * DIAGONAL_M),
        "focal_px": FOCAL_PX,
        "mirror_plane_deg": None,
        "temperature": 1.25,
        "object_ids": tuple(sweep.object_id for sweep in sweeps),
        "elevation_deg": np.array([sweep.elevation_deg for sweep in sweeps], dtype=np.float32),
        "sweep_weights": np.ones(len(sweeps), dtype=np.float32),
        "distributions": np.stack(rows),
        "affinity": {"power": 4.0, "pseudo_observations": 10.0},
        "ood": fit_ood(sweeps),
        "paper": PaperTables(
            np.array([0, 30], dtype=np.float32), rng.integers(15, 346, (2, 360)).astype(np.int16)
        ),
        "provenance": {"run": "made", "commit": "0" * 40, "packages": {"numpy": "2"}},
    }
    return Bundle(**{**values, **changes})


def frame(seed: int = 0, distance: float = 5.0, row: int = 45, column: int = 60):
    """A rough object before nothing, with a part to one side: metres, 0 where there is nothing."""
    rng = np.random.default_rng(seed)
    down, across = np.mgrid[:ROWS, :COLUMNS]
    depth = np.zeros((ROWS, COLUMNS), dtype=np.float32)
    apart = np.hypot((down - row) / 12.0, (across - column) / 9.0)
    depth[apart < 1] = (0.1 * apart**2)[apart < 1]
    side = np.hypot(down - row, across - column - rng.integers(-10, 11)) / rng.uniform(4, 8)
    depth[side < 1] = (0.2 * side - 0.1)[side < 1]
    seen = (apart < 1) | (side < 1)
    away = distance - 0.25 + depth + rng.normal(0, 0.01, depth.shape)
    return np.where(seen, away * DIAGONAL_M, 0).astype(np.float32)

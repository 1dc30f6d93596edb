"""A results tree with plausible content, made without any other part of the package.

Images show a hand that points to the azimuth; estimates err as a regressor does that cannot see a
mug's handle (around azimuth 90) or takes a back for a front. The lookup tables follow the paper's
equations by the shortest code that does.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from clock_faces import clock_faces

METHODS = ("single", "random", "opposite", "proposed")
N_VIEWS = 360
UNITS = (("mug", 0), ("mug", 30), ("chair", 0))
N_FOLDS = 3
N_OBJECTS, SIDE = 9, 20
DELTA_STEP = 12
HIDDEN = {"mug": (90.0, 50.0), "chair": (180.0, 25.0)}
FLIPPED = 0.01


def distance(a, b):
    return np.abs((np.asarray(a) - np.asarray(b) + 180.0) % 360.0 - 180.0)


def build_tree(root: Path) -> Path:
    """Write splits, depth, lookups, evaluations, settings and a benchmark; return `root`."""
    ids = [f"{index:04d}" for index in range(N_OBJECTS)]
    for category, elevation in UNITS:
        _write_splits(root, category, ids)
        rng = np.random.default_rng([0, len(category), elevation])
        directory = root / "depth" / category
        directory.mkdir(parents=True, exist_ok=True)
        hands = clock_faces(N_OBJECTS, N_VIEWS, SIDE, elevation)
        # Farther at the top of an image than at its bottom.
        images = np.where(hands > 0, hands + np.arange(SIDE, dtype=np.uint8)[:, None], 0)
        np.save(directory / f"el{elevation:02d}.npy", images)
        (directory / f"el{elevation:02d}_objects.json").write_text(json.dumps(ids))
        _write_folds(root, category, elevation, ids, _estimates(category, elevation, rng), rng)
    _write_surroundings(root)
    return root


def evaluation_files(root, units=UNITS, n_folds=N_FOLDS, methods=METHODS):
    """The files of errors by category, elevation, fold and method."""
    return {
        (category, elevation, fold, method): root
        / f"evaluation/{category}/el{elevation:02d}/fold{fold}/{method}.csv"
        for category, elevation in units
        for method in methods
        for fold in range(1, n_folds + 1)
    }


def lookup_files(root, units=UNITS, n_folds=N_FOLDS, criterion="pose_ambiguity"):
    """The lookup tables by category, elevation and fold."""
    return {
        (category, elevation, fold): root
        / f"lookup/{category}/el{elevation:02d}/fold{fold}/{criterion}.npz"
        for category, elevation in units
        for fold in range(1, n_folds + 1)
    }


def depth_files(root, units=UNITS):
    """The depth images by category and elevation."""
    return {unit: root / f"depth/{unit[0]}/el{unit[1]:02d}.npy" for unit in units}


def object_files(root, units=UNITS):
    """The objects of the depth images by category and elevation."""
    return {unit: root / f"depth/{unit[0]}/el{unit[1]:02d}_objects.json" for unit in units}


def split_files(root, units=UNITS):
    """The splits by category."""
    return {category: root / f"splits/{category}.csv" for category, _ in units}


def _write_splits(root, category, ids):
    rows = []
    for fold in range(1, N_FOLDS + 1):
        for index, name in enumerate(ids):
            role = "test" if index % N_FOLDS == fold - 1 else "train"
            rows.append((name, fold, "calibration" if role == "train" and index % 4 == 0 else role))
    path = root / "splits" / f"{category}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows, columns=["object_id", "fold", "role"]).to_csv(path, index=False)


def _estimates(category, elevation, rng):
    """(N_OBJECTS, 360) estimates: a bias and noise per object, a blind range, some half turns."""
    truth = np.arange(N_VIEWS, dtype=float)
    ease = 1.0 - elevation / 120.0
    bias = rng.normal(0, 2.5, (N_OBJECTS, 1)) * ease
    noise = rng.normal(0, 5.0, (N_OBJECTS, N_VIEWS)) * ease
    estimates = truth + bias + noise
    centre, half = HIDDEN[category]
    difference = (truth - centre + 180.0) % 360.0 - 180.0
    blind = np.abs(difference) < half * ease
    estimates = np.where(blind, centre + 0.25 * difference + bias + noise, estimates)
    flipped = rng.random((N_OBJECTS, N_VIEWS)) < FLIPPED * ease
    return (estimates + 180.0 * flipped) % 360.0


def _smooth(counts, bandwidth_deg):
    difference = np.minimum(np.arange(N_VIEWS), N_VIEWS - np.arange(N_VIEWS))
    kernel = np.exp(-0.5 * (difference / bandwidth_deg) ** 2)
    transform = np.fft.fft(kernel / kernel.sum())
    spread = np.fft.ifft2(np.fft.fft2(counts) * np.outer(transform, transform)).real
    return np.maximum(spread, 0.0)


def lookup_arrays(estimates, bandwidth_deg=9.0, pseudo_observations=5.0):
    """V, L, A and the recommendation from (n_objects, 360) estimates, as in Eqs. 1 to 6.

    A is exact at multiples of `DELTA_STEP` and held from each to the next.
    """
    counts = np.zeros((N_VIEWS, N_VIEWS))
    truth = np.broadcast_to(np.arange(N_VIEWS), estimates.shape)
    np.add.at(counts, (np.round(estimates).astype(int) % N_VIEWS, truth), 1.0)
    joint = _smooth(counts, bandwidth_deg) + pseudo_observations / N_VIEWS
    viewpoint = joint / joint.sum(axis=1, keepdims=True)
    estimate = (joint / joint.sum(axis=0, keepdims=True)).T
    cost = np.empty((N_VIEWS, N_VIEWS))
    for delta in range(0, N_VIEWS, DELTA_STEP):
        second = np.roll(viewpoint, (-delta, -delta), axis=(0, 1))
        both = viewpoint * second
        pose = viewpoint @ (both / both.sum(axis=1, keepdims=True))
        spread = -(pose * np.log(pose)).sum(axis=1)
        cost[:, delta : delta + DELTA_STEP] = spread[:, None]
    cost = cost.astype(np.float32)
    # Of equal costs the one that travels least, and of two such the first.
    delta = np.arange(N_VIEWS)
    rank = np.minimum(delta, N_VIEWS - delta) + delta / 1000
    least = cost == cost.min(axis=1, keepdims=True)
    return {
        "viewpoint_likelihood": viewpoint.astype(np.float32),
        "estimate_likelihood": estimate.astype(np.float32),
        "cost": cost,
        "recommended_delta_deg": np.where(least, rank, np.inf).argmin(axis=1),
        "bandwidth_deg": np.array(bandwidth_deg),
        "pseudo_observations": np.array(pseudo_observations),
        "pose_likelihood": np.array("given_estimate"),
        "spread": np.array("entropy"),
        "criterion": np.array("pose_ambiguity"),
    }


def _write_folds(root, category, elevation, ids, estimates, rng):
    unit = Path(category) / f"el{elevation:02d}"
    for fold in range(1, N_FOLDS + 1):
        test = np.arange(len(ids)) % N_FOLDS == fold - 1
        arrays = lookup_arrays(estimates[~test])
        target = root / "lookup" / unit / f"fold{fold}"
        target.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(target / "pose_ambiguity.npz", **arrays)
        names = [name for name, tested in zip(ids, test, strict=True) if tested]
        for method in METHODS:
            frame = evaluate(names, estimates[test], method, arrays["recommended_delta_deg"], rng)
            path = root / "evaluation" / unit / f"fold{fold}" / f"{method}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            frame.round(4).to_csv(path, index=False)


def evaluate(names, estimates, method, recommended, rng):
    """One row per object and initial viewpoint, in the columns of the contract."""
    n_objects = len(names)
    truth = np.broadcast_to(np.arange(N_VIEWS), estimates.shape)
    if method == "single":
        delta = following = np.full(estimates.shape, np.nan)
        pose = estimates
    else:
        delta = {
            "random": lambda: rng.integers(1, N_VIEWS, estimates.shape),
            "opposite": lambda: np.full(estimates.shape, 180),
            "proposed": lambda: recommended[np.round(estimates).astype(int) % N_VIEWS],
        }[method]()
        following = np.take_along_axis(estimates, (truth + delta) % N_VIEWS, axis=1)
        difference = (following - delta - estimates + 180.0) % 360.0 - 180.0
        pose = (estimates + difference / 2) % 360.0
    return pd.DataFrame(
        {
            "object_id": np.repeat(names, N_VIEWS),
            "initial_deg": np.tile(np.arange(N_VIEWS), n_objects),
            "initial_estimate_deg": estimates.ravel(),
            "delta_deg": delta.ravel(),
            "next_estimate_deg": following.ravel(),
            "pose_estimate_deg": pose.ravel(),
            "error_deg": distance(pose, truth).ravel(),
        }
    )


def _write_surroundings(root):
    elevations = {}
    for category, elevation in UNITS:
        elevations.setdefault(category, []).append(elevation)
    settings = {
        "experiment": "quick",
        "name": "synthetic",
        "seed": 0,
        "categories": list(elevations),
        "focus_category": "mug",
        "elevations_deg": {**elevations, "spoon": [0]},
        "n_folds": N_FOLDS,
        "dataset": {"source": "procedural"},
        "estimator": {"warm_start": "elevations"},
        "density": {
            "pose_likelihood": "given_estimate",
            "bandwidths_deg": [8.0],
            "pseudo_observations": [10.0],
        },
    }
    # JSON is YAML.
    (root / "configuration.yaml").write_text(json.dumps(settings, indent=2) + "\n")
    (root / "provenance.json").write_text(
        json.dumps(
            {
                "commit": "0123456789abcdef0123456789abcdef01234567",
                "python": "3.11.2",
                "platform": "Linux-x86_64",
                "packages": {"numpy": "2.4.0", "torch": "2.13.0"},
            }
        )
    )
    (root / "benchmark.tsv").write_text(
        "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"
        "34.5\t0:00:34\t812.25\t3000\t700\t710\t0\t12\t98.0\t33.25\n"
    )

"""Print how often bundles call other objects unfamiliar: other_objects.py BUNDLES > unfamiliar.csv.

Generated objects of all categories, of the bundle's usual size, are drawn as a first Kinect sees
them, each three times, from anywhere. See docs/bundles.md, what it does not know.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd

from nbv.core.angles import circular_distance_deg
from nbv.data.meshes import as_mesh
from nbv.data.normalisation import normalise
from nbv.data.procedural import CATEGORIES, generate
from nbv.errors import UserError
from nbv.robot.evaluation import LARGE_ERROR_DEG
from nbv.robot.recommender import Recommender
from nbv.robot.synthetic import draw_frame

N_OBJECTS, N_VIEWS = 24, 3

DATA_SEED, VIEW_SEED = 7, 5
"""Of objects that no bundle has seen, and of the places of the camera."""

ELEVATIONS_DEG, DISTANCES_M = (0.0, 60.0), (0.6, 1.1)

MUGS = {"least_reach": 0.2, "square_share": 0.15}
"""As of the mugs that the bundle learnt from."""


def counts(recommender: Recommender, category: str) -> dict[str, int]:
    """Return how many frames there are, and how many of them were answered, unfamiliar, wrong."""
    rng, frames = np.random.default_rng(VIEW_SEED), []
    for number in range(N_OBJECTS):
        solid = generate(category, DATA_SEED, number, **MUGS)
        mesh = as_mesh(normalise(solid, "+z", "+x", 0.0, "origin"))
        for _ in range(N_VIEWS):
            azimuth, elevation, distance = (
                rng.uniform(*bounds) for bounds in ((0.0, 360.0), ELEVATIONS_DEG, DISTANCES_M)
            )
            size = recommender.bundle.diagonal_m
            frame = draw_frame(mesh, azimuth, elevation, distance, size, seed=number)
            try:
                answer = recommender.recommend(frame.depth_m, intrinsics=frame.intrinsics)
            except UserError:
                continue
            error = circular_distance_deg(answer.azimuth_deg, azimuth)
            frames.append((answer.is_unfamiliar, error > LARGE_ERROR_DEG))
    unfamiliar, wrong = np.array(frames, dtype=bool).T
    return {
        "drawn": N_OBJECTS * N_VIEWS,
        "answered": len(frames),
        "unfamiliar": int(unfamiliar.sum()),
        "wrong": int(wrong.sum()),
        "wrong_unfamiliar": int((wrong & unfamiliar).sum()),
    }


def main() -> None:
    """Print a row for each bundle and category."""
    rows = []
    for training, name in enumerate(sys.argv[1:]):
        recommender = Recommender.load(name, "numpy")
        for category in CATEGORIES:
            found = counts(recommender, category)
            rows.append({"training": training, "category": category, **found})
    pd.DataFrame(rows).to_csv(sys.stdout, index=False)


if __name__ == "__main__":
    main()

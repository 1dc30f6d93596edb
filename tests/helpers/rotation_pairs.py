"""Pairs of an estimate and the truth in three dimensions, made for tests."""

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation


def orientation_pairs(n_objects=2, n_instances=2, n_images=6):
    """Objects of some instances; what looks from +x is upside down, and of low score."""
    rng = np.random.default_rng(0)
    tables = []
    for object_id, instance in np.ndindex(n_objects, n_instances):
        truth = Rotation.random(n_images, rng=rng).as_matrix()
        flips = truth[:, 2, 0] < -0.3
        flipped = np.where(flips[:, None, None], np.diag([1.0, -1, -1]), np.eye(3))
        small = Rotation.from_rotvec(rng.normal(0, 2, (n_images, 3)), degrees=True).as_matrix()
        columns = {
            "object_id": str(object_id),
            "scene_id": 1,
            "instance": instance,
            "im_id": np.arange(n_images),
            "R_true": _texts(truth),
            "t_true_mm": "0.00 0.00 700.00",
            "R_estimate": _texts(truth @ small @ flipped),
            "score": np.where(flips, 0.4, 0.9),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def _texts(matrices):
    return [" ".join(f"{x:.6f}" for x in matrix.ravel()) for matrix in matrices]

"""Poses anywhere within reach of an arm."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

seeds = st.integers(0, 10**6)


def random_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    pose[:3, 3] = rng.uniform(-2, 2, 3)
    return pose

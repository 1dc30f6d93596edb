"""Several views whose camera poses are of another convention."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.core.orientations.group import ASYMMETRIC
from nbv.errors import UserError
from nbv.tables.camera_poses import contradictions, not_seeing

OPENGL, MIRROR = np.diag([1.0, -1, -1, 1]), np.diag([1.0, -1, 1, 1])
ROS = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
N_TRIED = 30


def views(seed, n=2):
    """Right poses, and the object in each camera, not at the image's centre."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    seen = rng.uniform([-0.2, -0.2, 0.5], [0.2, 0.2, 1.2], (n, 3))
    place = rng.uniform(-1, 1, 3)
    poses[:, :3, 3] = place - (poses[:, :3, :3] @ seen[:, :, None])[..., 0]
    truth = Rotation.random(rng=rng).as_matrix()
    return poses, seen, poses[:, :3, :3].swapaxes(1, 2) @ truth


def in_mm(poses, per_m=1000):
    return poses * np.append(np.ones((4, 3)), [[per_m], [per_m], [per_m], [1]], axis=1)


def transposed(poses):
    turned = poses.copy()
    turned[:, :3, :3] = poses[:, :3, :3].swapaxes(1, 2)
    return turned


MISTAKES = {
    "OpenGL's": lambda poses: poses @ OPENGL,
    "a ROS body's": lambda poses: poses @ ROS,
    r"of other axes \(-y forward, -x down\)": lambda poses: poses @ ROS.T,
    "inverted": np.linalg.inv,
    "left-handed": lambda poses: MIRROR @ poses @ MIRROR,
    "in millimetres": in_mm,
    "in centimetres": lambda poses: in_mm(poses, 100),
    "with transposed rotations": transposed,
    "inverted .* and OpenGL's": lambda poses: np.linalg.inv(poses @ OPENGL),
    "inverted .* and in millimetres": lambda poses: in_mm(np.linalg.inv(poses)),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistaken_convention_is_named(name):
    named = 0
    for seed in range(N_TRIED):
        poses, *seen = views(seed)
        try:
            told = contradictions(MISTAKES[name](poses), *seen, ASYMMETRIC)
        except UserError as error:
            told = [str(error)]
        pattern = rf"agree if camera poses are {name}"
        named += any(re.search(pattern, text) for text in told)
    assert named >= 0.9 * N_TRIED


@pytest.mark.parametrize("n", [2, 4])
def test_right_poses_are_taken_whatever_flips_and_noise(n):
    for seed in range(N_TRIED):
        poses, seen, orientations = views(seed, n)
        rng = np.random.default_rng(seed)
        flipped = orientations @ Rotation.random(n, rng=rng).as_matrix()
        for given in (orientations, flipped):
            assert contradictions(poses, seen, given, ASYMMETRIC) == []
        noisy = seen * rng.uniform(0.97, 1.03, (n, 1))
        assert contradictions(poses, noisy, flipped, ASYMMETRIC) == []


@pytest.mark.parametrize("per_m", [50, 1000])
def test_a_unit_that_brings_no_agreement_is_not_named(per_m):
    for seed in range(N_TRIED):
        poses, *seen = views(seed)
        poses[1] = in_mm(poses[1:], per_m)[0]
        (told,) = contradictions(poses, *seen, ASYMMETRIC)
        assert "are the camera poses right?" in told


def test_another_instance_is_told():
    n_told = 0
    for seed in range(N_TRIED):
        poses, seen, orientations = views(seed)
        seen[1] += [0.3, 0.2, 0]
        try:
            (told,) = contradictions(poses, seen, orientations, ASYMMETRIC)
            n_told += "the same instance" in told
        except UserError:
            pass
    assert n_told >= 0.9 * N_TRIED


@pytest.mark.parametrize("name", ["OpenGL's", "a ROS body's", "inverted"])
@pytest.mark.parametrize("whose", ["candidates are", "`camera_pose` is", "they and .* are"])
def test_candidates_that_do_not_see_the_object_are_refused(name, whose):
    named = 0
    for seed in range(N_TRIED):
        poses, seen, _ = views(seed, 12)
        assert not_seeing(poses[1:], poses[0], seen[0], in_base=True) == []
        wrong = MISTAKES[name](poses)
        camera = poses[0] if whose == "candidates are" else wrong[0]
        others = poses[1:] if whose == "`camera_pose` is" else wrong[1:]
        try:
            not_seeing(others, camera, seen[0], in_base=True)
        except UserError as error:
            named += bool(re.search(f"{whose} {name}", str(error)))
    assert named >= 0.7 * N_TRIED

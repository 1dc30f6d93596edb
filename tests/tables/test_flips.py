"""What large errors share is found where it was made, and not claimed where errors are random."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.core.orientations.errors import OrientationErrors
from nbv.core.orientations.group import ASYMMETRIC, Symmetry, inverse
from nbv.tables.flips import describe_large_errors, named, shared_rotation

HALF_TURN = np.diag([-1.0, -1, 1])
SYMMETRIES = [
    ASYMMETRIC,
    Symmetry(np.stack([np.eye(3), HALF_TURN])),
    Symmetry(np.eye(3)[None], np.array([0.0, 0, 1])),
    Symmetry(np.stack([np.eye(3), np.diag([1.0, -1, -1])]), np.array([0.0, 0, 1])),
]
OTHER_AXES = Rotation.from_rotvec([30, 60, 90], degrees=True).as_matrix()


def made(n, seed):
    """Random truths (n, 3, 3), and rotations (n, 3, 3) of a few degrees."""
    rng = np.random.default_rng(seed)
    small = Rotation.from_rotvec(rng.normal(0, 2, (n, 3)), degrees=True).as_matrix()
    return Rotation.random(n, random_state=seed).as_matrix(), small


def twins(poses, symmetry):
    """The same poses (n, 3, 3), each as any of those that look the same."""
    towards = np.random.default_rng(9).normal(size=(len(poses), 3))
    return poses @ symmetry.towards(towards, poses)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_a_constant_rotation_is_found_on_either_side(symmetry):
    truth, small = made(60, 0)
    noise_deg = symmetry.distance_deg(truth @ small, truth).mean()
    seen = twins(truth, symmetry)
    for estimate, in_camera in (
        (seen @ OTHER_AXES @ small, False),
        (twins(OTHER_AXES @ truth @ small, symmetry), True),
    ):
        wrong = np.arange(60) % 6 == 0
        estimate[wrong] = made(60, 1)[0][wrong]
        errors = OrientationErrors(estimate, truth, symmetry)
        found, left_deg = shared_rotation(errors, in_camera=in_camera)
        twin = ASYMMETRIC if in_camera else symmetry
        assert twin.distance_deg(found.T, OTHER_AXES.T) < 2
        assert left_deg[~wrong].mean() == pytest.approx(noise_deg, abs=1)
        said = describe_large_errors(errors)
        assert ("C R_true" if in_camera else "R_true C") in said
        assert ("R_true C" if in_camera else "C R_true") not in said
        assert f"{(left_deg < 20).mean():.0%} of errors" in said


def test_sides_that_one_direction_cannot_separate_are_both_named():
    truth, small = made(60, 0)
    near = small @ truth[:1]
    said = describe_large_errors(OrientationErrors(OTHER_AXES @ near, near))
    assert "C R_true" in said
    assert "R_true C" in said


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_nothing_is_claimed_of_random_errors(symmetry):
    for seed in range(8):
        truth, small = made(40, seed)
        estimate, random = truth @ small, made(40, seed + 100)[0]
        estimate[:: 1 + seed % 3] = random[:: 1 + seed % 3]
        assert not describe_large_errors(OrientationErrors(estimate, truth, symmetry))


@pytest.mark.parametrize("symmetry", SYMMETRIES[:2])
@pytest.mark.parametrize(
    ("vector", "name"), [([180, 0, 0], "180° about x"), ([0, -90, 0], "-90° about y")]
)
def test_the_flip_of_most_large_errors_is_named(symmetry, vector, name):
    truth, small = made(60, 0)
    estimate = truth @ small
    estimate[:12] = truth[:12] @ Rotation.from_rotvec(vector, degrees=True).as_matrix() @ small[:12]
    estimate[12:15] = made(3, 5)[0]
    said = describe_large_errors(OrientationErrors(estimate, truth, symmetry))
    assert said.startswith("12 of 15 large errors are")
    assert name in said
    # Neither depends on the axes of the camera.
    turned = OrientationErrors(OTHER_AXES @ estimate, OTHER_AXES @ truth, symmetry)
    assert describe_large_errors(turned) == said


def test_a_rotation_is_named_by_angle_and_axis():
    for vector, name in (
        ([0, 0, 180], "180° about z"),
        ([0, 0, -179], "180° about z"),
        ([-90, 0, 0], "-90° about x"),
        ([60, 60, 0], "85° about 0.71 0.71 0"),
    ):
        rotation = Rotation.from_rotvec(vector, degrees=True).as_matrix()
        assert named(rotation) == name
        assert named(inverse(rotation)) == (name if "180" in name else f"-{name}".replace("--", ""))


def test_an_axis_about_which_an_object_looks_the_same_is_named():
    truth, small = made(60, 0)
    about = Rotation.from_rotvec(np.outer(np.linspace(-170, 170, 60), [0, 1, 0]), degrees=True)
    said = describe_large_errors(OrientationErrors(truth @ about.as_matrix() @ small, truth))
    assert "large errors are by different angles about y" in said

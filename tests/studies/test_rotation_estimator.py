"""The study's own estimator of orientations: its images, its training and its predictions."""

import numpy as np
import pandas as pd
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from studies.rotation_estimator import (
    fit_orientation_temperature,
    log_likelihood,
    mirrored,
    orientations_of,
    oriented_views,
    poses_of,
    predictions,
    train_orientations,
)
from studies.rotation_tables import estimator_table
from studies.solids import SOLIDS, solid

from nbv.core.orientations.group import ASYMMETRIC, spiral
from nbv.data.camera import Camera
from nbv.data.depth_codes import STEP, ZERO_CODE
from nbv.data.meshes import normalise
from nbv.data.procedural import generate
from nbv.data.render import open_renderer
from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
from nbv.experiment.estimation.inference import network_outputs

# The middle of the image is the object's origin, as the projection below has it.
CAMERA = Camera(distance=2.5, fov_deg=25.0, image_side=32, framing="axis")


def object_of(category):
    return normalise(generate(category, seed=0, index=0), "+z", "+x", 0.0, "box")


def depth_of(codes):
    depth = CAMERA.distance - STEP * (codes.astype(float) - ZERO_CODE)
    return np.where(codes > 0, depth, np.inf)


def projected(mesh, pose):
    """Depth by the nearest of many points on the surface, in BOP's convention."""
    points, _ = trimesh.sample.sample_surface(mesh, 400_000, seed=0)
    x, y, z = pose @ points.T + np.array([[0], [0], [CAMERA.distance]])
    column, row = (
        np.floor(CAMERA.focal_px * part / z + CAMERA.image_side / 2).astype(int) for part in (x, y)
    )
    depth = np.full((CAMERA.image_side, CAMERA.image_side), np.inf)
    np.minimum.at(depth, (row, column), z)
    return depth


def share_alike(depth, other):
    seen = np.isfinite(depth) | np.isfinite(other)
    with np.errstate(invalid="ignore"):
        return (np.abs(depth - other)[seen] < 0.05).mean()


def test_an_image_shows_its_pose():
    chair = object_of("chair")
    orientations = orientations_of("chair-0000", "chair", 2, seed=0)
    codes = oriented_views(chair, orientations, 3, CAMERA, open_renderer("embree"))
    poses = poses_of(orientations, 3).reshape(-1, 3, 3)
    images = [projected(chair, pose) for pose in poses]
    found = [[share_alike(depth_of(code), image) for image in images] for code in codes]
    # Points near an edge fall into a pixel or beside it.
    assert np.diag(found).min() > 0.6
    assert (np.argmax(found, axis=1) == np.arange(6)).all()


def test_a_mirror_image_shows_the_mirrored_pose():
    car = object_of("car")
    orientations = orientations_of("car-0000", "car", 2, seed=0)
    codes = oriented_views(car, orientations, 2, CAMERA, open_renderer("embree"))
    poses = mirrored(poses_of(orientations, 2).reshape(-1, 3, 3), 0.0)
    images = [projected(car, pose) for pose in poses]
    found = [[share_alike(depth_of(code[:, ::-1]), image) for image in images] for code in codes]
    assert np.diag(found).min() > 0.6
    assert (np.argmax(found, axis=1) == np.arange(4)).all()


@pytest.mark.parametrize(
    ("name", "order", "n_vertices"),
    [("tetrahedron", 12, 4), ("cube", 24, 8), ("icosahedron", 60, 12)],
)
def test_a_polyhedron_has_every_rotation_that_its_vertices_have(name, order, n_vertices):
    mesh, symmetry = solid(name)
    assert len(mesh.vertices) == n_vertices
    assert mesh.is_watertight
    vertices = mesh.vertices
    # Brute force: every pair of neighbours goes to every other one by one rotation at most.
    pair = vertices[mesh.edges_unique[0]]
    found = []
    for ends in np.concatenate([mesh.edges_unique, mesh.edges_unique[:, ::-1]]):
        rotation, _ = Rotation.align_vectors(vertices[ends], pair)
        apart = np.linalg.norm((rotation.apply(vertices))[:, None] - vertices, axis=2).min(axis=1)
        found += [rotation.as_matrix()] if apart.max() < 1e-6 else []
    assert len(found) == len(symmetry.discrete) == order
    apart = np.abs(np.array(found)[:, None] - symmetry.discrete).max(axis=(2, 3)).min(axis=1)
    assert apart.max() < 1e-6


@pytest.mark.parametrize(("name", "flips"), [("cone", False), ("cylinder", True)])
def test_what_turns_freely_may_have_two_ends(name, flips):
    mesh, symmetry = solid(name)
    upside_down = np.diag([1.0, -1.0, -1.0])[None]
    assert (symmetry.distance_deg(upside_down, np.eye(3)[None]) < 1e-6)[0] == flips
    rotated = Rotation.from_euler("z", 40, degrees=True).as_matrix()[None]
    assert symmetry.distance_deg(rotated, np.eye(3)[None])[0] < 1e-6
    assert np.linalg.norm(mesh.vertices[:, :2], axis=1).max() == pytest.approx(0.5)


def test_densities_are_per_volume_of_all_rotations():
    rng = np.random.default_rng(0)
    truth = Rotation.random(20, rng=rng).as_matrix()
    flat = np.zeros((20, 600))
    assert log_likelihood(flat, truth) == pytest.approx(-np.log(np.pi**2))
    cell = np.array([ASYMMETRIC.distance_deg(spiral(600), pose).argmin() for pose in truth])
    sure = np.where(np.arange(600) == cell[:, None], 100.0, 0.0)
    assert log_likelihood(sure, truth) == pytest.approx(np.log(600 / np.pi**2))
    # Probabilities that are sharpened by a factor are found flat again.
    logits = rng.normal(size=(4000, 30))
    p = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    drawn = np.array([rng.choice(30, p=own) for own in p])
    assert fit_orientation_temperature(3 * logits, spiral(30)[drawn]) == pytest.approx(3, rel=0.1)


def test_an_answer_is_the_mean_about_the_likeliest_pose():
    grid = spiral(4608)
    rng = np.random.default_rng(1)
    truth = Rotation.random(5, rng=rng).as_matrix()
    other = truth @ Rotation.from_euler("y", 150, degrees=True).as_matrix()
    cosines = [(np.tensordot(pose, grid, ((1, 2), (1, 2))) - 1) / 2 for pose in (truth, other)]
    density = 0.7 * np.exp(50 * (cosines[0] - 1)) + 0.3 * np.exp(50 * (cosines[1] - 1))
    found = predictions(np.log(density + 1e-30), truth, 1.0)
    assert ASYMMETRIC.distance_deg(found.estimate, truth).max() < 3
    assert found.score == pytest.approx(0.7, abs=0.06)


def test_a_classifier_learns_poses_and_their_mirror_images():
    camera = Camera(image_side=32)
    mug, renderer = object_of("mug"), open_renderer("embree")
    orientations = orientations_of("mug-0000", "mug", 3, seed=0)
    codes = oriented_views(mug, orientations, 8, camera, renderer)
    poses = poses_of(orientations, 8).reshape(-1, 3, 3)
    settings = {
        "channels": [16, 32],
        "hidden": 64,
        "n_classes": 300,
        "epochs": 60,
        "batch_size": 24,
        "learning_rate": 5e-3,
        "weight_decay": 0.0,
    }
    use_one_thread()
    hardware = choose_hardware("cpu", "float32")
    trained = train_orientations(codes, poses, settings, hardware, seed=0, plane_deg=90.0)
    for shown, pose in ((codes, poses), (codes[..., ::-1], mirrored(poses, 90.0))):
        outputs = network_outputs(trained, np.ascontiguousarray(shown), hardware)
        assert log_likelihood(outputs, pose).mean() > 1.0
        estimate = predictions(outputs, pose, 1.0).estimate
        assert np.median(ASYMMETRIC.distance_deg(estimate, pose)) < 25


def test_the_table_bounds_the_likelihood_of_a_solid_by_its_group():

    rng = np.random.default_rng(0)
    rows = [
        {
            "object_id": name,
            "instance": instance,
            "role": role,
            "log_likelihood": 1.0,
            "error_deg": e,
        }
        for name in ("mug", *SOLIDS)
        for instance in range(3)
        for role in ("calibration", "test")
        for e in rng.uniform(0, 40 if role == "test" else 180, 4)
    ]
    pairs = pd.DataFrame(rows)
    cells = estimator_table(pairs, 4608).cells.set_index("object_id")
    test = pairs[pairs["role"] == "test"].groupby("object_id")["error_deg"]
    assert cells["error_deg"].to_dict() == pytest.approx(test.mean().to_dict())
    bound = np.log(4608 / np.pi**2)
    assert cells.loc["mug", "most"] == pytest.approx(bound)
    assert cells.loc["cube", "most"] == pytest.approx(bound - np.log(24))
    assert cells.loc[["cone", "cylinder"], "most"].isna().all()

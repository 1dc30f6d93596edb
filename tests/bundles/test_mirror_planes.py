"""The mirror plane of a category: what it does to azimuths, and that it is found."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from nbv.bundles.network import Sweep, find_mirror_plane
from nbv.core.circle.angles import mirrored_bins
from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth
from nbv.data.meshes import normalise
from nbv.data.procedural import generate
from nbv.data.render import open_renderer

CAMERA = Camera(image_side=32)
N_CLASSES = 60


@given(st.integers(1, 180), st.integers(0, 359))
def test_a_class_and_its_mirror_image_lie_on_both_sides_of_the_plane(n_classes, place):
    plane_deg = place % n_classes * 180 / n_classes
    mirrored = mirrored_bins(n_classes, plane_deg)
    assert np.array_equal(mirrored[mirrored], np.arange(n_classes))
    middle_deg = (np.arange(n_classes) + mirrored) * 180 / n_classes - plane_deg
    assert np.allclose(middle_deg / 180, np.rint(middle_deg / 180))


def images_of(mesh: trimesh.Trimesh, azimuth_deg) -> np.ndarray:
    depth = open_renderer("embree").render(mesh.vertices, mesh.faces, 30.0, azimuth_deg, CAMERA)
    return encode_depth(depth, CAMERA)


def network_of_templates(mesh: trimesh.Trimesh, seed: int = 0):
    """A network: how like an image is to noisy images of a mesh, one for each class."""
    templates = images_of(mesh, np.arange(N_CLASSES) * (360 / N_CLASSES)).astype(np.float32)
    templates += np.random.default_rng(seed).normal(0, 60, templates.shape).astype(np.float32)
    flat = templates.reshape(N_CLASSES, -1)

    def network(codes):
        rows = codes.reshape(len(codes), -1).astype(np.float32)
        apart = (rows**2).sum(axis=1)[:, None] - 2 * rows @ flat.T + (flat**2).sum(axis=1)
        return (-apart / 1e5).astype(np.float32)

    return network


def sweeps_of(network, meshes) -> list[Sweep]:
    azimuth_deg = np.arange(48) * 7.5
    codes = [images_of(mesh, azimuth_deg) for mesh in meshes]
    return [Sweep(str(i), "", 30.0, azimuth_deg, network(c), c) for i, c in enumerate(codes)]


def objects(category: str, n: int) -> list[trimesh.Trimesh]:
    return [normalise(generate(category, 1, i), "+z", "+x", 0.0, "origin") for i in range(n)]


def symmetry_plane_deg(mesh: trimesh.Trimesh) -> float:
    """The azimuth in which the camera sees a mesh that is its own mirror image, by its images."""
    views = np.arange(0, 180, 90.0)
    images = images_of(mesh, views).astype(float)
    return float(views[np.abs(images - images[:, :, ::-1]).sum(axis=(1, 2)).argmin()])


@pytest.mark.parametrize("category", ["mug", "chair", "car"])
def test_the_plane_of_a_category_is_found(category):
    (mesh,) = objects(category, 1)
    network = network_of_templates(mesh)
    found = find_mirror_plane(network, sweeps_of(network, [mesh]))
    assert found == symmetry_plane_deg(mesh)


def test_objects_that_are_not_their_own_mirror_image_have_no_plane():
    (mug,) = objects("mug", 1)
    lump = trimesh.creation.box((0.12, 0.3, 0.2))
    lump.apply_translation((0.15, 0.25, 0.1))
    both = trimesh.util.concatenate([mug, lump])
    network = network_of_templates(both)
    assert find_mirror_plane(network, sweeps_of(network, [both])) is None

"""Embree's depths, compared with depths computed without it."""

import builtins

import numpy as np
import pytest
import trimesh

from nbv.data.camera import Camera, object_views
from nbv.data.render import open_renderer
from nbv.errors import UserError
from rendering_shapes import procedural, rotated, shape_of, triangle_soup


def brute_force(shape, elevation, azimuths, camera):
    """Möller and Trumbore's test of every ray with every triangle, in double precision.

    Returns the depths, and how far, in barycentric coordinates, each ray passes from the nearest
    edge of any triangle: a ray that grazes an edge may hit or miss.
    """
    views = object_views(*shape, elevation, azimuths, camera)
    side = camera.image_side
    centres = np.arange(side) + 0.5
    a, b, c = shape.vertices[shape.faces].transpose(1, 0, 2)
    edge1, edge2 = b - a, c - a
    depths, margins = [], []
    for view, (column, row) in enumerate(views.principal_px):
        x = ((centres - column) / camera.focal_px)[None, :, None]
        y = ((row - centres) / camera.focal_px)[:, None, None]
        ray = views.forward[view] + x * views.right[view] + y * views.up[view]
        ray = ray.reshape(-1, 1, 3)
        across = np.cross(ray, edge2)
        determinant = (across * edge1).sum(-1)
        from_a = views.position[view] - a
        u = (across * from_a).sum(-1) / determinant
        along = np.cross(from_a, edge1)
        v = (ray * along).sum(-1) / determinant
        t = (edge2 * along).sum(-1) / determinant
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
        depth = np.where(inside >= 0, t, np.inf).min(axis=1)
        depths.append(np.where(np.isfinite(depth), depth, 0.0).reshape(side, side))
        margins.append(np.abs(inside).min(axis=1).reshape(side, side))
    return np.array(depths), np.array(margins)


@pytest.mark.parametrize("framing", ["silhouette", "axis"])
@pytest.mark.parametrize("elevation", [0.0, 37.0, 90.0])
@pytest.mark.parametrize(
    "shape",
    [triangle_soup(0, 40), shape_of(trimesh.creation.icosphere(subdivisions=2))],
    ids=["soup", "sphere"],
)
def test_depths_are_those_of_a_brute_force_caster(embree, shape, elevation, framing):
    camera = Camera(image_side=32, framing=framing)
    azimuths = [0.0, 33.3, 200.0]
    depth = embree.render(*shape, elevation, azimuths, camera)
    expected, margin = brute_force(shape, elevation, azimuths, camera)
    sure = margin > 1e-5
    assert sure.mean() > 0.95
    assert ((depth > 0) == (expected > 0))[sure].all()
    assert np.abs(depth - expected)[sure].max() < 1e-5
    assert 0.05 < (depth > 0).mean() < 0.95


def test_a_sphere_has_the_same_image_from_everywhere_and_the_right_size(embree):
    sphere = shape_of(trimesh.creation.icosphere(subdivisions=5))
    radius = 0.5 / np.sqrt(3.0)
    for framing in ("silhouette", "axis"):
        camera = Camera(framing=framing, image_side=65)
        depth = embree.render(*sphere, 30.0, np.arange(0, 360, 40), camera)
        assert np.allclose(depth[:, 32, 32], camera.distance - radius, atol=1e-3)
        seen_px = camera.focal_px * np.tan(np.arcsin(radius / camera.distance))
        assert np.allclose((depth > 0).sum(axis=(1, 2)), np.pi * seen_px**2, rtol=0.01)


@pytest.mark.parametrize("category", ["mug", "chair"])
def test_rotating_the_object_rolls_the_azimuths(embree, category):
    shape = procedural(category)
    azimuths = np.arange(0, 360, 15)
    camera = Camera()
    depth = embree.render(*shape, 15.0, azimuths, camera)
    for steps in (1, 6, 17):
        rolled = embree.render(*rotated(shape, 15.0 * steps), 15.0, azimuths, camera)
        expected = np.roll(depth, steps, axis=0)
        # Single precision moves a ray by 1e-7; some edge lies within that of a few rays.
        assert (np.abs(rolled - expected) > 1e-5).mean() < 1e-3


def test_many_small_calls_equal_one_large_one(embree):
    shape = procedural("chair")
    azimuths = np.arange(0, 360, 5)
    together = embree.render(*shape, 0.0, azimuths, Camera())
    apart = np.concatenate([embree.render(*shape, 0.0, [a], Camera()) for a in azimuths])
    assert np.array_equal(together, apart)


def test_a_missing_library_is_named_with_the_way_out(monkeypatch):
    real_import = builtins.__import__

    def without_embreex(name, *args, **kwargs):
        if name.startswith("embreex"):
            raise ImportError(f"No module named {name!r}")
        return real_import(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_embreex)
    with pytest.raises(UserError, match=r"embreex.*renderer=pyrender") as caught:
        open_renderer("embree")
    assert "\n" not in str(caught.value)


def test_an_unknown_renderer_is_named_with_the_nearest():
    with pytest.raises(UserError, match=r"renderer=embre: .*did you mean 'embree'"):
        open_renderer("embre")

"""What is drawn at random for a camera: what it may change, and what it has to leave alone."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import ndimage

from nbv.data.camera import Camera, object_views
from nbv.data.depth_codes import crop_measured, encode_depth, sensor_camera
from nbv.data.randomisation import Randomisation, add_table, lose, move_edge, randomised_sweep
from rendering_shapes import procedural

CAMERA = Camera(fov_deg=25.0, image_side=48)
AZIMUTHS = np.arange(0.0, 360.0, 45.0)
NOTHING = Randomisation(
    **dict.fromkeys((one.name for one in fields(Randomisation)), 0)
    | {"nearest": None, "farthest": None, "measured": 1}
)


@pytest.fixture(scope="module")
def mesh():
    return procedural("mug")


def sweep_of(mesh, embree, draw, seed=0, elevation=20.0):
    rng = np.random.default_rng(seed)
    return randomised_sweep(mesh, elevation, AZIMUTHS, CAMERA, embree, None, 0.17, draw, rng)


@pytest.mark.parametrize("elevation", [20.0, 88.0])
def test_where_nothing_varies_it_is_the_rendered_image(mesh, embree, elevation):
    depth = embree.render(mesh.vertices, mesh.faces, elevation, AZIMUTHS, sensor_camera(CAMERA))
    wanted = encode_depth(crop_measured(depth, CAMERA), CAMERA)
    assert np.array_equal(sweep_of(mesh, embree, NOTHING, elevation=elevation), wanted)


def test_a_camera_on_its_head_sees_the_image_on_its_head(mesh, embree):
    upright = embree.render(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    upside_down = embree.render(
        mesh.vertices, mesh.faces, 20.0, AZIMUTHS, replace(CAMERA, roll_deg=180.0)
    )
    assert np.allclose(upside_down[:, ::-1, ::-1], upright, atol=1e-4)


def test_a_camera_that_leans_to_the_right_sees_the_right_above(embree):
    # A plate to the right of the axis, seen from azimuth 0, where +y is right.
    vertices = np.array([[0, 0, -0.05], [0, 0.45, -0.05], [0, 0.45, 0.05], [0, 0, 0.05]])
    camera = Camera(image_side=48, framing="axis", roll_deg=90.0)
    depth = embree.render(vertices, [[0, 1, 2], [0, 2, 3]], 0.0, [0.0], camera)[0]
    rows, columns = np.nonzero(depth)
    assert rows.max() < 24
    assert abs(columns.mean() + 0.5 - 24) < 1


def test_distance_leaves_the_size_of_a_pixel_on_the_object(mesh, embree):
    near = sweep_of(mesh, embree, NOTHING)
    far = sweep_of(mesh, embree, replace(NOTHING, nearest=8.0, farthest=8.0))
    for one, other in zip(near, far, strict=True):
        box = [np.ptp(np.nonzero(image), axis=1) for image in (one, other)]
        # Perspective makes the near half larger than the far one.
        assert np.abs(box[0] - box[1]).max() <= 3


@pytest.mark.parametrize("kind", ["table", "cutout"])
def test_the_table_is_level_and_lies_under_the_object(mesh, embree, kind):
    rng = np.random.default_rng(0)
    depth = embree.render(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    views = object_views(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    floor = float(mesh.vertices[:, 2].min())
    with_table = depth.copy()
    add_table(with_table, views, floor, replace(NOTHING, **{kind: 1}), rng)
    assert np.array_equal(with_table[depth > 0], depth[depth > 0])
    view, row, column = np.nonzero(with_table != depth)
    assert len(view) > 20
    principal = views.principal_px[view]
    x = (column + 0.5 - principal[:, 0]) / CAMERA.focal_px
    y = (principal[:, 1] - row - 0.5) / CAMERA.focal_px
    rays = views.forward[view] + x[:, None] * views.right[view] + y[:, None] * views.up[view]
    points = views.position[view] + with_table[view, row, column][:, None] * rays
    assert points[:, 2] == pytest.approx(floor, abs=1e-4)


@pytest.mark.parametrize("loss", ["thin", "split", "inside", "occluded", "patches"])
def test_a_loss_takes_pixels_away_and_changes_no_other(mesh, embree, loss):
    depth = embree.render(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    before, lost, rng = depth.copy(), 0, np.random.default_rng(0)
    for image, whole in zip(depth, before, strict=True):
        lose(image, replace(NOTHING, **{loss: 1}), rng)
        kept = image > 0
        assert np.array_equal(image[kept], whole[kept])
        lost += np.count_nonzero(whole > 0) - np.count_nonzero(kept)
    assert lost > 0


def test_a_hole_in_the_body_has_a_rim_at_another_depth(mesh, embree):
    depth = embree.render(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    rims, rng = 0, np.random.default_rng(0)
    for image in depth:
        whole = image.copy()
        lose(image, replace(NOTHING, hole=1), rng)
        lost, moved = (whole > 0) & (image == 0), (image > 0) & (image != whole)
        assert 0.02 < lost.sum() / (whole > 0).sum() < 0.6
        assert ndimage.label(lost)[1] == 1
        assert not (moved & ~ndimage.binary_dilation(lost, iterations=5)).any()
        assert np.abs(image - whole)[moved].max(initial=0.0) <= 0.1
        rims += moved.any()
    assert rims > len(depth) / 2


def test_a_split_handle_keeps_its_ends(mesh, embree):
    (whole,) = embree.render(mesh.vertices, mesh.faces, 5.0, np.zeros(1), CAMERA)
    split = whole.copy()
    lose(split, replace(NOTHING, split=1), np.random.default_rng(1))
    rows = np.nonzero((whole > 0) & (split == 0))[0]
    handle = np.nonzero((whole > 0) & ~ndimage.binary_opening(whole > 0, iterations=3))[0]
    assert handle.min() < rows.min() <= rows.max() < handle.max()


def test_a_wrong_focal_length_makes_the_object_wider_and_not_deeper(mesh, embree):
    sizes, reliefs = [], []
    for seed in range(20):
        codes = sweep_of(mesh, embree, replace(NOTHING, focal=0.2), seed)[0]
        seen = codes > 0
        sizes.append(np.ptp(np.nonzero(seen.any(axis=1))[0]) + 1)
        reliefs.append(int(codes[seen].max()) - int(codes[seen].min()))
    whole = sweep_of(mesh, embree, NOTHING)[0]
    tall = np.ptp(np.nonzero((whole > 0).any(axis=1))[0]) + 1
    assert 0.75 * tall < min(sizes) < 0.9 * tall
    assert 1.1 * tall < max(sizes) < 1.25 * tall
    assert np.ptp(reliefs) <= 0.1 * np.mean(reliefs)


def test_an_edge_that_moves_leaves_the_middle_and_takes_depths_from_nearby(mesh, embree):
    whole = embree.render(mesh.vertices, mesh.faces, 20.0, AZIMUTHS, CAMERA)
    rng, grown, shrunk = np.random.default_rng(0), 0, 0
    for image in whole:
        moved = image.copy()
        move_edge(moved, 2.0, rng)
        seen, new = image > 0, moved > 0
        both = seen & new
        assert np.array_equal(moved[both], image[both])
        assert np.isin(moved[new], image[seen]).all()
        # Outwards by five standard deviations at most, inwards by a pixel.
        assert (ndimage.distance_transform_edt(~seen)[new & ~seen] < 11).all()
        assert (ndimage.distance_transform_edt(seen)[seen & ~new] <= 1.5).all()
        grown, shrunk = grown + (new & ~seen).sum(), shrunk + (seen & ~new).sum()
    assert grown > 0
    assert shrunk > 0


@pytest.mark.parametrize("seed", range(20))
def test_an_edge_moves_as_far_as_all_pairs_of_pixels_say(seed):
    rng = np.random.default_rng(seed)
    blob = ndimage.gaussian_filter(rng.standard_normal((23, 31)), 3.0) > rng.normal(0.05, 0.05)
    blob[rng.integers(23), rng.integers(31)] = False
    image = np.where(blob, 1 + rng.random(blob.shape), 0).astype(np.float32)
    moved, largest = image.copy(), 3.0
    move_edge(moved, largest, np.random.default_rng(seed))
    # The same field, drawn in the same order.
    again = np.random.default_rng(seed)
    noise = again.standard_normal(image.shape, dtype=np.float32)
    field = ndimage.gaussian_filter(noise, again.uniform(1.0, 4.0))
    field = np.maximum(field * (again.uniform(0.0, largest) / field.std()), -1.0)
    inside, outside = np.argwhere(blob), np.argwhere(~blob)
    apart = np.sqrt(((inside[:, None] - outside) ** 2).sum(axis=2))
    for pixel, to_edge in zip(inside, apart.min(axis=1), strict=True):
        is_kept = 0.5 - to_edge < field[tuple(pixel)]
        assert moved[tuple(pixel)] == (image[tuple(pixel)] if is_kept else 0)
    for pixel, distances in zip(outside, apart.T, strict=True):
        is_added = distances.min() - 0.5 < field[tuple(pixel)]
        nearest = inside[distances == distances.min()]
        wanted = image[tuple(nearest.T)] if is_added else [0]
        assert moved[tuple(pixel)] in wanted


def test_a_sweep_depends_on_its_generator_alone(mesh, embree):
    draw = Randomisation(
        *(7.5, 5, 0.15, 3, 7, 0.1),
        *(0.6, 0.3, 0.1, 0.1, 0.1, 0.25, 0.1, 0.15),
        *(1, 2, 1.5),
    )
    one, again, other = (sweep_of(mesh, embree, draw, seed) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)

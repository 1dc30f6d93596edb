"""Frames drawn of a mesh: what a camera in that place would see."""

import numpy as np
import pytest

from frame_images import shape
from nbv.data.camera import Camera
from nbv.data.meshes import Mesh
from nbv.errors import UserError
from nbv.frames.crop import crop_frame
from nbv.frames.synthetic import HEIGHT, WIDTH, draw_frame, example_frame, read_mesh

DIAGONAL_M = 0.2


def drawn(azimuth=30.0, distance=0.9, **more):
    vertices, faces = shape()
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.int32))
    return draw_frame(mesh, azimuth, 10.0, distance, DIAGONAL_M, **more)


def test_without_noise_the_points_lie_on_the_object():
    """In the object's frame all lie within its sphere, and some near its surface's extremes."""
    frame = drawn(sensor="none")
    rows, columns = np.nonzero(frame.mask)
    z = frame.depth_m[rows, columns]
    camera = frame.intrinsics
    x, y = (columns - camera.cx) * z / camera.fx, (rows - camera.cy) * z / camera.fy
    apart = np.sqrt(x**2 + y**2 + (z - 0.9) ** 2)
    assert apart.max() < 0.5 * DIAGONAL_M * 1.01
    assert np.ptp(x) > 0.4 * DIAGONAL_M
    assert np.ptp(y) > 0.4 * DIAGONAL_M


def test_noise_moves_depths_by_millimetres_and_depends_on_the_seed():
    true, one, again, other = (
        drawn(sensor="none"),
        drawn(seed=1),
        drawn(seed=1),
        drawn(seed=2),
    )
    assert np.array_equal(one.depth_m, again.depth_m)
    assert not np.array_equal(one.depth_m, other.depth_m)
    both = true.mask & one.mask
    assert 0.0005 < np.abs(one.depth_m - true.depth_m)[both].mean() < 0.006


def test_a_stereo_camera_has_its_own_image_and_noise():
    true, kinect, stereo = (drawn(sensor=name) for name in ("none", "kinect", "stereo"))
    assert true.intrinsics == kinect.intrinsics
    assert (stereo.intrinsics.fx, stereo.intrinsics.cx, stereo.intrinsics.width) == (
        424,
        423.5,
        848,
    )
    assert stereo.depth_m.shape == (HEIGHT, 848)
    steps = [np.unique(frame.depth_m).size for frame in (stereo, true)]
    assert steps[0] < steps[1]
    apart = np.median(stereo.depth_m[stereo.mask]) - np.median(true.depth_m[true.mask])
    assert abs(apart) < 0.01


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"sensor": "stero"}, "`sensor`=stero: did you mean 'stereo'"),
        ({"seed": -1}, "`seed`=-1: give 0 or more"),
        ({"distance": 0.31}, "`distance_m`=0.31: kinect measures only from 0.33 m on"),
    ],
)
def test_what_no_camera_can_take_is_refused(more, message):
    with pytest.raises(UserError, match=message):
        drawn(**more)


def test_size_and_distance_in_proportion_give_the_same_crop():
    """The noise would tell them apart."""
    vertices, faces = shape()
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.int32))
    crops = []
    for factor in (1.0, 2.0):
        size = factor * DIAGONAL_M
        frame = draw_frame(mesh, 70.0, 5.0, factor * 0.9, size, sensor="none")
        crop = crop_frame(frame.depth_m, frame.mask, frame.intrinsics, Camera(), size)
        crops.append(crop.codes)
    assert np.array_equal(*crops)


def test_the_example_is_a_mug_with_its_handle_in_sight():
    """At azimuth 270 the handle is before the cup; at 90 behind it, and the mug seems narrower."""
    before, behind, aside = (example_frame(azimuth, 0.0) for azimuth in (270.0, 90.0, 0.0))
    assert before.depth_m.shape == (HEIGHT, WIDTH)
    nearest = [np.quantile(f.depth_m[f.mask], 0.02) for f in (before, behind)]
    assert nearest[0] < nearest[1] - 0.01
    widths = [np.ptp(np.nonzero(f.mask.any(axis=0))) for f in (behind, aside)]
    assert widths[1] > 1.2 * widths[0]


def test_a_mesh_file_is_read_with_its_axes(tmp_path):
    (tmp_path / "wedge.obj").write_text(
        "v 0 0 0\nv 4 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    )
    mesh = read_mesh(tmp_path / "wedge.obj", up="+x", front="+y")
    size = np.ptp(mesh.vertices, axis=0)
    assert size.argmax() == 2
    assert np.linalg.norm(size) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("cup.npy", "", "unknown kind of mesh file; give .obj, .ply, .off, .stl, .glb"),
        ("cup.obj", "a cup\n", "no line is a vertex, 'v x y z'; is it an OBJ file?"),
    ],
)
def test_a_file_without_a_mesh_is_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError) as error:
        read_mesh(tmp_path / name)
    assert str(error.value).startswith(f"{tmp_path / name}: ")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("view", "message"),
    [
        ((np.nan, 10.0, 0.9), "`azimuth_deg`=nan: give degrees"),
        ((0.0, 91.0, 0.9), "`elevation_deg`=91"),
        ((0.0, 10.0, 0.0), "`distance_m`=0"),
        ((0.0, 10.0, 0.2), "0.3 to 4 m are plausible"),
    ],
)
def test_an_impossible_view_is_refused(view, message):
    vertices, faces = shape()
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.int32))
    with pytest.raises(UserError, match=message):
        draw_frame(mesh, *view, DIAGONAL_M)


def test_a_frame_without_the_object_is_refused():
    """A needle far away falls between the pixels."""
    vertices = np.array([[0, 0, -0.5], [1e-6, 0, -0.5], [0, 1e-6, 0.5]], dtype=np.float32)
    needle = Mesh(vertices, np.array([[0, 1, 2]], dtype=np.int32))
    with pytest.raises(UserError, match="no pixel of the object"):
        draw_frame(needle, 20.0, 0.0, 3.9, DIAGONAL_M, sensor="none")


@pytest.mark.parametrize("diagonal", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_size_is_refused(diagonal):
    vertices, faces = shape()
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.int32))
    with pytest.raises(UserError, match="diagonal"):
        draw_frame(mesh, 0.0, 0.0, 0.8, diagonal)

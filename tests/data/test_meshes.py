"""Every way a file can lie in its own frame, and the one frame it ends in."""

import itertools
import zipfile

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nbv.data.meshes import (
    AXES,
    Mesh,
    check_mesh,
    direction,
    frame_rotation,
    load_meshes,
    normalise,
    save_meshes,
)
from nbv.errors import UserError
from nbv.files import read_arrays, write_arrays

PAIRS = [(up, front) for up, front in itertools.permutations(AXES, 2) if up[1] != front[1]]
FACES = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
TETRAHEDRA = arrays(np.float64, (4, 3), elements=st.floats(-100, 100, width=32)).filter(
    lambda v: np.linalg.norm(np.ptp(v, axis=0)) > 1e-2
)


def tetrahedron(vertices):
    return trimesh.Trimesh(vertices, FACES, process=False)


@pytest.mark.parametrize(("up", "front"), PAIRS)
@settings(max_examples=20)
@given(azimuth_deg=st.floats(-720, 720))
def test_rotations_are_proper_and_take_the_axes_where_they_belong(up, front, azimuth_deg):
    rotation = frame_rotation(up, front, azimuth_deg)
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.isclose(np.linalg.det(rotation), 1.0)
    assert np.allclose(rotation @ direction(up, "up"), [0, 0, 1])
    azimuth = np.radians(azimuth_deg)
    expected = [np.cos(azimuth), np.sin(azimuth), 0]
    assert np.allclose(rotation @ direction(front, "front"), expected)


@pytest.mark.parametrize(("up", "front"), PAIRS)
def test_vectors_and_axes_say_the_same(up, front):
    def vector(axis, comma):
        return comma.join(str(value) for value in direction(axis, "up"))

    expected = frame_rotation(up, front, 0.0)
    assert np.allclose(frame_rotation(vector(up, ","), vector(front, r"\,"), 0.0), expected)


def test_rounded_vectors_still_rotate_properly():
    rotation = frame_rotation("0.001,0.999,0.01", "0.99,0.002,0", 30.0)
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.isclose(np.linalg.det(rotation), 1.0)


@pytest.mark.parametrize(("up", "front"), PAIRS)
@settings(max_examples=20)
@given(
    vertices=TETRAHEDRA, azimuth_deg=st.floats(0, 360), centre=st.sampled_from(["box", "origin"])
)
def test_shape_is_kept_and_size_and_place_are_set(up, front, vertices, azimuth_deg, centre):
    mesh = normalise(tetrahedron(vertices), up, front, azimuth_deg, centre)
    result = np.asarray(mesh.vertices)
    low, high = result.min(axis=0), result.max(axis=0)
    assert np.isclose(np.linalg.norm(high - low), 1.0)
    assert np.isclose(low[2], -high[2])
    if centre == "box":
        assert np.allclose(low, -high)
    # A similarity without reflection: volumes, with their sign, scale by the cube.
    sides = [np.linalg.norm(v[1:] - v[0], axis=1) for v in (vertices, result)]
    scale = sides[1].max() / sides[0][sides[1].argmax()] if sides[1].max() > 0 else 0.0
    assert np.allclose(sides[1], scale * sides[0], atol=1e-9)
    volumes = [np.linalg.det(v[1:] - v[0]) for v in (vertices, result)]
    assert np.isclose(volumes[1], scale**3 * volumes[0], atol=1e-9)


@given(vertices=TETRAHEDRA)
def test_the_origin_may_stay_the_vertical_axis(vertices):
    whole = normalise(tetrahedron(vertices), "+z", "+x", 0.0, "origin")
    rotated = normalise(tetrahedron(vertices), "+z", "+x", 180.0, "origin")
    assert np.allclose(np.asarray(rotated.vertices) * [-1, -1, 1], whole.vertices)
    scale = np.linalg.norm(np.ptp(vertices, axis=0))
    assert np.allclose(np.asarray(whole.vertices)[:, :2] * scale, vertices[:, :2])


def test_vertices_that_no_face_uses_play_no_part():
    vertices = np.random.default_rng(0).normal(size=(4, 3))
    stray = np.vstack([[50.0, 50.0, 50.0], vertices, [np.nan, 0.0, 0.0]])
    mesh = trimesh.Trimesh(stray, np.array(FACES) + 1, process=False)
    check_mesh(mesh, "stray.obj")
    cleaned = normalise(mesh, "+y", "-x", 10.0, "box")
    plain = normalise(tetrahedron(vertices), "+y", "-x", 10.0, "box")
    assert np.allclose(cleaned.vertices, plain.vertices)
    assert np.array_equal(cleaned.faces, plain.faces)


@pytest.mark.parametrize(
    ("up", "front", "named"),
    [
        ("+y", "-y", r"up=\+y, front=-y: .*perpendicular"),
        ("+q", "+x", r"up=\+q: not an axis"),
        ("0,0,0", "+x", "up=0,0,0: not an axis"),
    ],
)
def test_axes_without_sense_are_refused(up, front, named):
    with pytest.raises(UserError, match=named) as caught:
        frame_rotation(up, front, 0.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("vertices", "faces", "named"),
    [
        (np.eye(4, 3), np.empty((0, 3), int), "no faces"),
        ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]], "vertex 1 is not finite, 1 of 3"),
        (np.ones((3, 3)), [[0, 1, 2]], "in one point"),
        ([[0, 0, 0], [1e38, 0, 0], [0, 1, 0]], [[0, 1, 2]], "extends over 1e.38, vertex 1"),
        (np.eye(3) * 1e-30, [[0, 1, 2]], "extends over"),
        (np.eye(4, 3), [[0, 1, 1], [2, 2, 3]], "no area"),
    ],
)
def test_a_mesh_that_cannot_be_drawn_is_refused_by_name(vertices, faces, named):
    mesh = trimesh.Trimesh(process=False)
    mesh.vertices, mesh.faces = np.asarray(vertices, float), faces
    with pytest.raises(UserError, match=f"^some/file.ply: .*{named}") as caught:
        check_mesh(mesh, "some/file.ply")
    assert "\n" not in str(caught.value)


@pytest.fixture
def meshes():
    made = {
        "ball": trimesh.creation.icosphere(subdivisions=2),
        "a box, named at length": trimesh.creation.box(),
        "0": trimesh.creation.annulus(0.5, 1.0, 2.0),
    }
    return {name: normalise(mesh, "+z", "+x", 0.0, "box") for name, mesh in made.items()}


def test_what_is_saved_is_loaded_in_its_order(tmp_path, meshes):
    path = tmp_path / "mug.npz"
    save_meshes(path, meshes)
    loaded = load_meshes(path)
    assert list(loaded) == list(meshes)
    for name, mesh in loaded.items():
        assert isinstance(mesh, Mesh)
        assert mesh.vertices.dtype == np.float32
        assert mesh.faces.dtype == np.int32
        assert np.array_equal(mesh.vertices, meshes[name].vertices.astype(np.float32))
        assert np.array_equal(mesh.faces, meshes[name].faces)


def test_bytes_depend_on_the_meshes_alone(tmp_path, meshes):
    save_meshes(tmp_path / "a.npz", meshes)
    save_meshes(tmp_path / "b.npz", meshes)
    save_meshes(tmp_path / "c.npz", load_meshes(tmp_path / "a.npz"))
    contents = {path.read_bytes() for path in tmp_path.iterdir()}
    assert len(contents) == 1


def changed(name, change):
    def damage(arrays):
        arrays[name] = change(arrays[name].copy())

    return damage


def at(place, value):
    def change(array):
        array[place] = value
        return array

    return change


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda arrays: arrays.pop("faces"), "holds no array 'faces'"),
        (changed("vertices", lambda array: array[:, :2]), "'vertices' has another form"),
        (changed("ids", at(1, "ball")), "an id is duplicate"),
        (changed("face_offsets", at(1, 0)), "'face_offsets' does not fit"),
        (changed("vertices", at((0, 0), np.nan)), "the mesh of 'ball' is not sound"),
        (changed("faces", at((0, 0), 10_000)), "the mesh of 'ball' is not sound"),
    ],
)
def test_damage_is_named_with_the_file(tmp_path, meshes, damage, named):
    path = tmp_path / "mug.npz"
    save_meshes(path, meshes)
    arrays = read_arrays(path)
    damage(arrays)
    write_arrays(path, arrays)
    with pytest.raises(UserError) as caught:
        load_meshes(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert named in message
    assert "\n" not in message


def test_an_array_whose_first_bytes_are_damaged_is_named(tmp_path, meshes):
    path = tmp_path / "mug.npz"
    save_meshes(path, meshes)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content.replace(b"\x93NUMPY", b"\x93NUMPX"))
    with pytest.raises(UserError, match="array 'ids' is damaged"):
        load_meshes(path)

"""Meshes to a file and back."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest
import trimesh

from nbv.data.meshes import Mesh, load_meshes, normalise, save_meshes
from nbv.errors import UserError
from nbv.files import read_arrays, write_arrays


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


def test_nothing_is_pickled(tmp_path, meshes):
    save_meshes(tmp_path / "a.npz", meshes)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as stored:
        assert all(stored[name].dtype != object for name in stored.files)


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

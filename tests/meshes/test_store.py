"""Meshes to a file and back."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from nbv.errors import UserError
from nbv.files import read_arrays, write_arrays
from nbv.meshes.store import Mesh, load_meshes, save_meshes


@pytest.fixture
def meshes():
    return {
        "ball": trimesh.creation.icosphere(subdivisions=2),
        "a box, named at length": trimesh.creation.box(),
        "0": trimesh.creation.annulus(0.5, 1.0, 2.0),
    }


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


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("faces", lambda faces: faces + 1000),
        ("faces", lambda faces: -faces - 1),
        ("vertices", lambda vertices: vertices * np.nan),
        ("vertices", lambda vertices: vertices[:, :2]),
        ("ids", lambda ids: ids[:-1]),
        ("ids", lambda ids: np.array(["0", "0", "0"])),
        ("face_offsets", lambda offsets: offsets[::-1]),
        ("vertex_offsets", lambda offsets: offsets * 0),
    ],
)
def test_meshes_that_cannot_be_are_refused(tmp_path, meshes, name, change):
    path = tmp_path / "mug.npz"
    save_meshes(path, meshes)
    whole = read_arrays(path)
    write_arrays(path, whole | {name: change(whole[name])})
    with pytest.raises(UserError, match=r"mug\.npz: .*; delete the file and run"):
        load_meshes(path)

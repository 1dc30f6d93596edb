"""What each format may hold, and what is refused although trimesh would take it."""

from __future__ import annotations

import json
import os
import struct

import numpy as np
import pytest
import trimesh
from mesh_files import READER, refused

from nbv.data.mesh_formats import parse_mesh

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
)
STL = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box())


def read(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return READER.read(path)


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3\nf 1 3 4\n",
        "f 1 2 3 4\n",
        "f -4 -3 -2 -1\n",
        "  f\t1 2 3 \n f 1 3 4\n",
        "usemtl a#1\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 3/1 4/1\nvt 0 0\n",
        "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1",
        "f 1 2 \\\n3\nf 1 3 4\n",
    ],
)
def test_a_square_is_a_square_in_every_way_of_writing_it(tmp_path, faces):
    assert np.isclose(read(tmp_path / "square.obj", OBJ + faces).area, 1.0)
    assert np.isclose(read(tmp_path / "windows.obj", (OBJ + faces).replace("\n", "\r\n")).area, 1.0)


def test_a_byte_order_mark_and_another_encoding_lose_no_vertex(tmp_path):
    text = f"{OBJ}# caf\u00e9\nf 1 2 3\n"
    for content in (text.encode("utf-8-sig"), text.encode("latin-1")):
        assert np.isclose(read(tmp_path / "a.obj", content).area, 0.5)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (OBJ + "f 0 1 2\n", "line 5: a face refers to vertex 0"),
        (OBJ + "f -1 -2 -5\n", "line 5: a face refers to vertex -5, of 4 so far"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nv 5 5 5\n", "relative indices"),
        (OBJ + "f 1 2\nf 1 2 3\n", "line 5: not a face"),
        (OBJ + "vt 0 0\nf 1/1 2/1 3/1\nf 1 2 3 4 1 2\n", "two forms are mixed"),
        ("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "line 1: a vertex of 2 coordinates, not 3"),
        ("v 0 0 0 1\nv 1 0 0\nv 0 1 0 1 1\nf 1 2 3\n", "different numbers of coordinates"),
        (b"v 0 0 0\nv 1 0\xff1 0\nv 0 1 0\nf 1 2 3\n", "cannot be read as a mesh"),
    ],
)
def test_an_obj_that_trimesh_would_misread_is_refused(tmp_path, content, named):
    refused(lambda: read(tmp_path / "bad.obj", content), tmp_path / "bad.obj", named)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (OFF + "3 0 1 3\n", "7 lines are there, the header announces 6"),
        (OFF.replace("3 0 1 2", "3 0 1"), "a face was cut short"),
        ("hello\nworld\n", "it does not begin with OFF; is it an OFF file?"),
        ("bell \x07 \x9f" + OFF, "bell ? ?OFF is not a kind"),
    ],
)
def test_an_off_that_trimesh_would_misread_is_refused(tmp_path, content, named):
    assert len(read(tmp_path / "good.off", OFF).faces) == 2
    bad = tmp_path / "bad.off"
    assert refused(lambda: read(bad, content), bad, named).isprintable()


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (PLY + "3 0 1 3\n", "7 lines are there, the header announces 6"),
        (PLY.replace("3 0 2 3", "4 0 2 3"), "not a face as the header"),
        (PLY.replace("1 1 0\n", "1 1 0 7\n"), "not a vertex as the header"),
        (PLY.replace("1 1 0\n", "1 1 x\n"), "cannot be read as a mesh"),
    ],
)
def test_an_ascii_ply_that_trimesh_would_misread_is_refused(tmp_path, content, named):
    assert len(read(tmp_path / "good.ply", PLY).faces) == 2
    refused(lambda: read(tmp_path / "bad.ply", content), tmp_path / "bad.ply", named)


def test_a_binary_ply_whose_lists_differ_in_length_is_refused(tmp_path):
    content = bytearray(trimesh.creation.box().export(file_type="ply"))
    content[-13] = 5  # the last face's number of corners
    refused(lambda: read(tmp_path / "bad.ply", bytes(content)), "another length than the first")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("endloop", ""),
        ("vertex", "vertez"),
        ("endsolid", ""),
    ],
)
def test_an_ascii_stl_that_trimesh_would_misread_is_refused(tmp_path, old, new):
    assert len(read(tmp_path / "good.stl", STL).faces) == 12
    refused(lambda: read(tmp_path / "bad.stl", STL.replace(old, new, 1)), tmp_path / "bad.stl")


def glb(change=lambda header: None, surplus=b""):
    """Return a box as GLB, its header changed."""
    content = trimesh.creation.box().export(file_type="glb")
    _, _, _, size, kind = struct.unpack("<5I", content[:20])
    header = json.loads(content[20 : 20 + size])
    change(header)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :] + surplus
    return (
        struct.pack("<5I", 0x46546C67, 2, 20 + len(text) + len(rest), len(text), kind) + text + rest
    )


def points_at(uri):
    return lambda header: header["buffers"][0].update(uri=uri)


@pytest.mark.parametrize(
    "uri", ["pipe", "../../etc/passwd", "/etc/passwd", "http://localhost/a.bin"]
)
def test_a_glb_leads_to_no_other_file(tmp_path, uri):
    os.mkfifo(tmp_path / "pipe")
    assert len(read(tmp_path / "good.glb", glb()).faces) == 12
    bad = tmp_path / "bad.glb"
    refused(lambda: read(bad, glb(points_at(uri))), bad, f"it refers to '{uri}'")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda header: header.update(extensionsRequired=["KHR_draco_mesh_compression"]), "draco"),
        (lambda header: header["accessors"][0].update(sparse={"count": 1}), "sparse"),
        (lambda header: header["meshes"][0]["primitives"][0].update(mode=6), "mode 6"),
    ],
)
def test_a_glb_of_which_trimesh_would_leave_something_out_is_refused(tmp_path, change, named):
    refused(lambda: read(tmp_path / "bad.glb", glb(change)), tmp_path / "bad.glb", named)


def test_an_index_beyond_its_own_part_is_refused(tmp_path):
    """It would be a vertex of the next part once the parts are joined."""
    scene = trimesh.Scene([trimesh.creation.box(), trimesh.creation.box()])
    content = bytearray(scene.export(file_type="glb"))
    size = struct.unpack("<5I", content[:20])[3]
    header = json.loads(content[20 : 20 + size])
    part = header["meshes"][0]["primitives"][0]
    view = header["bufferViews"][header["accessors"][part["indices"]]["bufferView"]]
    at = 20 + size + 8 + view.get("byteOffset", 0)
    content[at : at + 4] = struct.pack("<I", 8)
    refused(lambda: read(tmp_path / "two.glb", bytes(content)), "vertex 8, of 8 vertices")


def test_textures_are_not_decoded(tmp_path, monkeypatch):
    """A picture of a few kilobytes may take gigabytes of memory."""
    image = pytest.importorskip("PIL.Image")
    picture = image.new("L", (10, 10))
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(np.zeros((8, 2)), image=picture)
    opened = []
    monkeypatch.setattr(image, "open", opened.append)
    for extension in ("glb", "obj", "ply"):
        path = tmp_path / f"picture.{extension}"
        box.export(path)
        parse_mesh(path)
    assert not opened
    trimesh.load_scene(tmp_path / "picture.glb")
    assert opened

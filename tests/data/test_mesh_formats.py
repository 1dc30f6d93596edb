"""What each format may hold, and what is refused although trimesh would take it."""

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
        "f -4 -3 -2\nv 5 5 5\nf 1 3 4\n",
        "vt 0 0\nf 1/1 2/1 3/1\nf 1 3 4\n",
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
        (OBJ + "f 1 2\nf 1 2 3\n", "line 5: not a face"),
        (OBJ + "f 1 2/x 3\n", "line 5: not a face"),
        (OBJ + "f 1 2 4 3\n", "crosses itself"),
        (OBJ + "f 1 2 9\n", "a face refers to vertex 8, of 4 vertices"),
        ("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "line 1: a vertex of 2 coordinates, not 3"),
        (b"v 0 0 0\nv 1 0\xff1 0\nv 0 1 0\nf 1 2 3\n", "cannot be read as a mesh"),
    ],
)
def test_an_obj_that_trimesh_would_misread_is_refused(tmp_path, content, named):
    refused(lambda: read(tmp_path / "bad.obj", content), tmp_path / "bad.obj", named)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (OFF + "3 0 1 3\n", "7 lines are there, the header announces 6"),
        (OFF.replace("3 0 1 2", "3 0 1"), "not a whole face"),
        (OFF.replace("1 1 0", "1 1"), "not a vertex of 3 coordinates: '1 1'"),
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
        (PLY.replace("uchar int", "uchar float"), "face 0 has not 3"),
        (PLY.replace("float z", "float w"), "no 'z'"),
    ],
)
def test_an_ascii_ply_that_trimesh_would_misread_is_refused(tmp_path, content, named):
    assert len(read(tmp_path / "good.ply", PLY).faces) == 2
    refused(lambda: read(tmp_path / "bad.ply", content), tmp_path / "bad.ply", named)


@pytest.mark.parametrize("n_corners", [0, 2, 5])
def test_a_binary_ply_with_a_wrong_number_of_corners_is_refused(tmp_path, n_corners):
    content = bytearray(trimesh.creation.box().export(file_type="ply"))
    content[-13] = n_corners  # of the last face
    refused(lambda: read(tmp_path / "bad.ply", bytes(content)), tmp_path / "bad.ply")


def as_obj(vertices, polygons):
    rows = [f"v {x} {y} {z}" for x, y, z in vertices]
    rows += ["f " + " ".join(f"{i + 1}/1" for i in polygon) for polygon in polygons]
    return "\n".join([*rows, "vt 0 0"])


def as_off(vertices, polygons):
    rows = [f"OFF {len(vertices)} {len(polygons)} 0", *(f"{x} {y} {z}" for x, y, z in vertices)]
    return "\n".join([*rows, *(" ".join(map(str, (len(p), *p))) for p in polygons)])


def as_ply(vertices, polygons, order="ascii"):
    """Return a PLY file with a colour of each vertex, and lists besides the corners."""
    form = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {form} 1.0\ncomment made here\nelement vertex {len(vertices)}\n"
        "property double x\nproperty double y\nproperty double z\nproperty uchar red\n"
        f"element face {len(polygons)}\nproperty list uchar float texcoord\n"
        "property list uchar uint vertex_indices\nend_header\n"
    )
    if order == "ascii":
        rows = [f"{x} {y} {z} 7" for x, y, z in vertices]
        rows += [" ".join(map(str, (1, 0.5, len(p), *p))) for p in polygons]
        return head + "\n".join(rows)
    body = b"".join(struct.pack(f"{order}3dB", *vertex, 7) for vertex in vertices)
    for p in polygons:
        body += struct.pack(f"{order}Bf", 1, 0.5) + struct.pack(f"{order}B{len(p)}I", len(p), *p)
    return head.encode() + body


WRITERS = {
    "a.obj": as_obj,
    "a.off": as_off,
    "a.ply": as_ply,
    "little.ply": lambda *shape: as_ply(*shape, "<"),
    "big.ply": lambda *shape: as_ply(*shape, ">"),
}

# Each with its area: of one polygon, and of the mesh.
ARROW = np.array([(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)])
ANGLES = np.radians([0, 90, 180, 270, 270, 180, 90, 0])
HANDLE = np.c_[0.0 * ANGLES, np.cos(ANGLES), np.sin(ANGLES)] * np.repeat([2.0, 1.0], 4)[:, None]
FRAME = np.array([(0, 0, 1), (4, 0, 1), (4, 4, 1), (0, 4, 1), (1, 1, 1), (1, 3, 1), (3, 3, 1)])


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(
    ("vertices", "polygon", "area"),
    [
        (ARROW, (0, 1, 2, 3), 1.5),
        (ARROW, (2, 1, 0, 3), 1.5),
        (ARROW, (1, 2, 3, 0), 1.5),
        (HANDLE, range(8), 4.5),
        (np.vstack([FRAME, (3, 1, 1)]), (0, 1, 2, 3, 0, 4, 5, 6, 7, 4), 12.0),
        (np.vstack([ARROW[:3], (1.0, 0.5, 0)]), (0, 3, 1, 2), 2.0),
        (np.vstack([ARROW, ARROW[:1]]), (0, 4, 1, 2, 3), 1.5),
    ],
    ids=["arrow", "backwards", "from its side", "handle", "hole", "straight", "twice"],
)
def test_a_polygon_beside_others_covers_what_it_covers(tmp_path, name, vertices, polygon, area):
    rotation = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.5, 0.9]))[:3, :3]
    vertices = np.vstack([vertices @ rotation.T, np.eye(3) + 9.0])
    n = len(vertices)
    mesh = read(tmp_path / name, WRITERS[name](vertices, [(n - 3, n - 2, n - 1), polygon]))
    assert np.isclose(mesh.area, area + np.sqrt(0.75))
    # One side looks the same way everywhere.
    assert np.isclose(
        np.linalg.norm((mesh.area_faces[:, None] * mesh.face_normals)[1:].sum(0)), area
    )


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(
    "vertices",
    [
        [(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)],
        [(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 1, 0)],
        [(np.cos(a), 0, np.sin(a)) for a in np.arange(5) * 2.4 * np.pi / 3],
        [(np.cos(a) * (1 + a), np.sin(a) * (1 + a), 0) for a in np.arange(12)],
    ],
    ids=["bow tie", "uneven bow tie", "star", "spiral"],
)
def test_a_polygon_that_crosses_itself_is_refused(tmp_path, name, vertices):
    content = WRITERS[name](vertices, [range(len(vertices))])
    refused(lambda: read(tmp_path / name, content), tmp_path / name, "crosses itself")


def test_polygons_with_no_dent_are_fans(tmp_path):
    """The triangles that the meshes of earlier results had."""
    vertices = [(0, 0, 0), (1, 0, 0), (1.5, 1, 0), (0.5, 1.7, 0), (-0.5, 1, 0.2)]
    mesh = read(tmp_path / "fan.off", as_off(vertices, [range(5)]))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


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

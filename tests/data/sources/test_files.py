"""What the sources of files have in common: reading, exclusions, and messages about bad files."""

from __future__ import annotations

import logging
import os

import numpy as np
import pandas as pd
import pytest
import trimesh

from mesh_files import READER, pointer, put, refused, source_of
from nbv.data.sources import prepare_meshes, select_objects
from nbv.files import read_csv, write_csv


def test_the_parts_of_a_scene_keep_their_places(tmp_path):
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=1)
    for x in (-3.0, 5.0):
        scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "two.glb")
    mesh = READER.read(tmp_path / "two.glb")
    assert len(mesh.faces) == 2 * len(ball.faces)
    assert np.allclose(mesh.bounds[:, 0], [-4.0, 6.0])


def test_materials_and_their_absence_are_passed_over_in_silence(tmp_path, caplog):
    file = put(tmp_path / "mug" / "one.obj", trimesh.creation.box())
    file.write_text("mtllib not/there.mtl\nusemtl gone\n" + file.read_text())
    with caplog.at_level(logging.DEBUG):
        source_of("folder", root=str(tmp_path)).load("mug", "one")
    assert not caplog.records


def test_two_files_of_one_name_are_both_named(tmp_path):
    paths = [put(tmp_path / "mug" / f"one.{extension}") for extension in ("obj", "ply")]
    refused(lambda: source_of("folder", root=str(tmp_path)).object_ids("mug"), *paths)


def test_an_unknown_object_is_named(tmp_path):
    put(tmp_path / "mug" / "one.ply")
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: source.load("mug", "two"), "two", tmp_path / "mug")


def test_axes_without_sense_are_named_with_the_file(tmp_path):
    path = put(tmp_path / "mug" / "one.ply")
    source = source_of("folder", root=str(tmp_path), up="+y", front="+y")
    refused(lambda: source.load("mug", "one"), path, "up=+y, front=+y", "perpendicular")


def empty(path):
    path.write_bytes(b"")


def no_faces_ply(path):
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n"
    )


def truncated(path):
    put(path)
    path.write_bytes(path.read_bytes()[:-200])


def truncated_text(path):
    pointer().export(path, encoding="ascii")
    path.write_bytes(path.read_bytes()[:-20])


def garbage(path):
    path.write_bytes(np.random.default_rng(0).bytes(500))


@pytest.mark.parametrize(
    ("extension", "spoil"),
    [
        *[("obj", spoil) for spoil in (empty, garbage)],
        *[("ply", spoil) for spoil in (empty, no_faces_ply, truncated, truncated_text, garbage)],
        *[("glb", spoil) for spoil in (empty, truncated, garbage)],
        *[("off", spoil) for spoil in (empty, garbage, truncated)],
        *[("stl", spoil) for spoil in (empty, garbage, truncated)],
    ],
)
def test_a_bad_file_is_named_in_one_line(tmp_path, extension, spoil):
    path = tmp_path / "mug" / f"bad.{extension}"
    path.parent.mkdir()
    spoil(path)
    source = source_of("folder", root=str(tmp_path))
    message = refused(lambda: source.load("mug", "bad"), path)
    assert message.startswith(str(path))


@pytest.fixture
def root(tmp_path):
    for name in ("a", "b", "c"):
        put(tmp_path / "mug" / f"{name}.ply", trimesh.creation.box())
    return tmp_path


def test_ids_are_left_out_by_list_and_by_file(root):
    listed = root / "leave_out.txt"
    listed.write_text("# mugs without a handle\n\nb  # broken off\n")
    source = source_of("folder", root=str(root), exclude=["a"], exclude_file=str(listed))
    assert source.object_ids("mug") == ["c"]
    refused(lambda: select_objects(source, "mug", 2), "holds 1 usable meshes")


def test_a_misspelt_id_among_good_ones_is_warned_of(root, caplog):
    assert source_of("folder", root=str(root), exclude=["a", "z"]).object_ids("mug")
    assert "1 listed exclusions are not among the files of mug, the first is z" in caplog.text


def test_a_list_for_other_categories_is_none_of_this_one_s_business(root, caplog):
    source = source_of("folder", root=str(root), exclude=["x", "z"])
    assert source.object_ids("mug") == ["a", "b", "c"]
    assert not caplog.records


def test_a_missing_list_is_named(root):
    path = root / "no.txt"
    refused(lambda: source_of("folder", root=str(root), exclude_file=str(path)), path)


@pytest.mark.parametrize("name", [b"two\nlines", b"return\r", b"tab\t", b"latin \xe9", b"bell\x07"])
def test_names_that_would_break_a_table_or_a_line_are_refused(tmp_path, name):
    put(tmp_path / "mug" / "one.ply")
    (tmp_path / "mug" / os.fsdecode(name + b".ply")).write_bytes(b"")
    message = refused(lambda: source_of("folder", root=str(tmp_path)).object_ids("mug"), "rename")
    assert message.isascii()
    assert message.isprintable()


def test_names_with_spaces_commas_and_quotes_work(tmp_path):
    names = ["a, b", "c 'd' \"e\"", "{f} %g $h", "Täße", "#i;j", "k" * 200]
    for i, name in enumerate(names):
        put(tmp_path / "mug" / f"{name}.ply", trimesh.creation.box((1, 1 + i, 1)))
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == sorted(names)
    assert list(prepare_meshes(source, "mug", names)) == names


def test_names_with_spaces_commas_and_quotes_survive_a_table(tmp_path):
    names = ["a, b", "c 'd' \"e\"", "{f} %g $h", "Täße", " #i;j ", "NA", "007"]
    write_csv(tmp_path / "t.csv", pd.DataFrame({"object_id": names, "fold": 1}))
    assert list(read_csv(tmp_path / "t.csv")["object_id"]) == names


def test_a_pipe_among_the_meshes_is_named_and_not_opened(tmp_path):
    put(tmp_path / "mug" / "one.ply")
    os.mkfifo(tmp_path / "mug" / "pipe.ply")
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: source.object_ids("mug"), tmp_path / "mug" / "pipe.ply", "not a regular file")
    listed = tmp_path / "list"
    os.mkfifo(listed)
    refused(lambda: source_of("folder", root=str(tmp_path), exclude_file=str(listed)), listed)


def test_a_category_without_meshes_is_named(tmp_path):
    (tmp_path / "mug").mkdir()
    source = source_of("folder", root=str(tmp_path))
    refused(lambda: select_objects(source, "mug", None), tmp_path / "mug", "no usable meshes")


@pytest.mark.parametrize("name", ["folder", "shapenet", "modelnet"])
def test_paths_that_the_system_refuses_are_named(tmp_path, name):
    long = str(tmp_path / ("x" * 300))
    refused(lambda: source_of(name, root=long).object_ids("mug"), "xxx", "too long")
    labelled = source_of(name, root=str(tmp_path), categories={"mug": "y" * 300})
    refused(lambda: labelled.object_ids("mug"), "yyy", "too long")


def test_a_list_of_exclusions_without_an_end_is_not_read(root):
    """A device or a pipe; the empty device stands for those that would fill the memory."""
    refused(
        lambda: source_of("folder", root=str(root), exclude_file="/dev/null"), "not a regular file"
    )

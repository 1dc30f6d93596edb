"""A folder of one's own meshes."""

from __future__ import annotations

import numpy as np
import pytest

from mesh_files import REAL, needs_real, pointer, points_to, put, refused, source_of
from nbv.data.sources.files import EXTENSIONS


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_each_format_is_read_checked_and_normalised(tmp_path, extension):
    put(tmp_path / "mug" / f"one{extension}", pointer((0, 0, 1)))
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == ["one"]
    mesh = source.load("mug", "one")
    assert len(mesh.faces) == 24
    assert np.isclose(np.linalg.norm(np.ptp(mesh.vertices, axis=0)), 1.0)
    assert points_to(mesh) == "+x"


def test_other_files_and_letter_case_do_not_matter(tmp_path):
    put(tmp_path / "mug" / "one.ply").rename(tmp_path / "mug" / "one.PLY")
    (tmp_path / "mug" / "README.txt").write_text("not a mesh")
    source = source_of("folder", root=str(tmp_path))
    assert source.object_ids("mug") == ["one"]
    source.load("mug", "one")


def test_a_category_may_have_another_folder_and_front(tmp_path):
    put(tmp_path / "cups" / "one.ply", pointer((0, 0, 1)))
    source = source_of(
        "folder", root=str(tmp_path), categories={"mug": "cups"}, turn_deg={"mug": 270}
    )
    assert points_to(source.load("mug", "one")) == "-y"


def test_a_relative_root_is_below_the_working_directory(tmp_path, monkeypatch):
    put(tmp_path / "data" / "mug" / "one.ply")
    monkeypatch.chdir(tmp_path)
    assert source_of("folder", root="data").object_ids("mug") == ["one"]


def test_missing_folders_are_named(tmp_path):
    nowhere = tmp_path / "nowhere"
    refused(lambda: source_of("folder", root=None), "dataset.root is not set")
    source = source_of("folder", root=str(nowhere))
    refused(lambda: source.object_ids("mug"), nowhere, "does not exist", "dataset.root")
    source = source_of("folder", root=str(tmp_path))
    absent = (tmp_path / "mug", "does not exist", "out of categories")
    refused(lambda: source.object_ids("mug"), *absent)
    (tmp_path / "mug").write_text("")
    refused(lambda: source.object_ids("mug"), tmp_path / "mug", "is not a folder")


@needs_real
def test_real_toilets_have_their_cisterns_behind():
    source = source_of("folder", root=str(REAL / "meshes"))
    for object_id in source.object_ids("toilet"):
        vertices = np.asarray(source.load("toilet", object_id).vertices)
        top = vertices[vertices[:, 2] > np.quantile(vertices[:, 2], 0.9)]
        assert top[:, 0].mean() < 0

"""ModelNet's layout."""

from __future__ import annotations

import pytest

from mesh_files import pointer, points_to, put, refused, source_of


def test_both_parts_and_the_mugs_other_name(tmp_path):
    put(tmp_path / "cup" / "train" / "cup_0001.off", pointer((0, -1, 0)))
    put(tmp_path / "cup" / "test" / "cup_0080.off", pointer((0, -1, 0)))
    source = source_of("modelnet", root=str(tmp_path))
    assert source.object_ids("mug") == ["cup_0001", "cup_0080"]
    assert points_to(source.load("mug", "cup_0080")) == "-y"


@pytest.mark.parametrize("header", ["OFF4 4 0", "OFF 4 4 0", "OFF\n4 4 0", "OFF\n# c\n\n4 4 0"])
def test_counts_glued_to_the_header_are_read(tmp_path, header):
    path = tmp_path / "chair" / "train" / "chair_0001.off"
    path.parent.mkdir(parents=True)
    body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
    path.write_text(f"{header}\n{body}")
    mesh = source_of("modelnet", root=str(tmp_path)).load("chair", "chair_0001")
    assert mesh.is_watertight
    assert len(mesh.vertices) == len(mesh.faces) == 4


def test_missing_folders_are_named(tmp_path):
    (tmp_path / "chair").mkdir()
    source = source_of("modelnet", root=str(tmp_path))
    refused(lambda: source.object_ids("chair"), tmp_path / "chair", "train", "test")
    refused(lambda: source.object_ids("car"), tmp_path / "car", "does not exist")

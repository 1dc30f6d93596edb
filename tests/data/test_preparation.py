"""All meshes of a category at once."""

from __future__ import annotations

import itertools
import logging
import time

import numpy as np
import pytest
import trimesh

from mesh_files import put, source_of
from nbv.data.copies import find_copies
from nbv.data.meshes import as_mesh
from nbv.data.sources import prepare_meshes
from nbv.errors import UserError


@pytest.fixture
def root(tmp_path):
    for i in range(12):
        put(tmp_path / "mug" / f"m{i:02d}.ply", trimesh.creation.box((1, 1 + i / 12, 1)))
    return tmp_path


def test_meshes_come_in_the_order_asked_for(root):
    source = source_of("folder", root=str(root))
    ids = source.object_ids("mug")[::-1]
    prepared = prepare_meshes(source, "mug", ids)
    assert list(prepared) == ids
    assert np.array_equal(prepared["m04"].faces, source.load("mug", "m04").faces)


def test_every_bad_file_is_logged_and_the_first_is_raised(root, caplog):
    bad = [root / "mug" / f"m{i:02d}.ply" for i in (3, 7, 8)]
    for path in bad:
        path.write_bytes(b"")
    source = source_of("folder", root=str(root))
    with pytest.raises(UserError, match=r"and 2 more, logged above.*dataset.exclude") as caught:
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert str(caught.value).startswith(str(bad[0]))
    assert "\n" not in str(caught.value)
    errors = [record.message for record in caplog.records if record.levelno == logging.ERROR]
    assert [line.startswith(str(path)) for line, path in zip(errors, bad, strict=True)] == [
        True
    ] * 3


def test_progress_is_logged(root, caplog, monkeypatch):
    monkeypatch.setattr(time, "monotonic", itertools.count(step=10.0).__next__)
    source = source_of("folder", root=str(root))
    with caplog.at_level(logging.INFO, logger="nbv"):
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert "mug meshes: 3 of 12, 90 s left" in caplog.text
    assert "mug meshes: 12 in 130.0 s" in caplog.text


def finer(mesh, rng):
    """The same surface in smaller triangles, with vertices and faces in another order."""
    fine = mesh.subdivide()
    order = rng.permutation(len(fine.vertices))
    faces = rng.permutation(np.argsort(order)[fine.faces])
    return trimesh.Trimesh(fine.vertices[order], faces, process=False)


def test_copies_are_named_with_what_leaves_them_out(root):
    rng = np.random.default_rng(0)
    ring = trimesh.creation.torus(1.0, 0.3)
    for name, mesh in {
        "a": ring,
        "b": finer(ring, rng).apply_scale(3.0),
        "c": trimesh.creation.torus(1.0, 0.33),
        "d": finer(ring, rng),
    }.items():
        put(root / "mug" / f"{name}.ply", mesh)
    source = source_of("folder", root=str(root))
    with pytest.raises(UserError, match=r"mug: b is a copy of a, d is a copy of a;") as caught:
        prepare_meshes(source, "mug", source.object_ids("mug"))
    assert str(caught.value).endswith("dataset.exclude=[b,d]")


def test_no_surface_is_taken_for_another_of_the_same_size():
    """A box with a hole has the extents of the box without it."""
    box = trimesh.creation.box((1, 2, 1.5))
    frame = trimesh.util.concatenate(
        [
            trimesh.creation.box((1, 2, 0.4), trimesh.transformations.translation_matrix((0, 0, z)))
            for z in (-0.55, 0.55)
        ]
    )
    meshes = {name: as_mesh(mesh) for name, mesh in {"box": box, "frame": frame}.items()}
    assert find_copies(meshes) == {}
    assert find_copies(meshes | {"again": meshes["frame"]}) == {"again": "frame"}

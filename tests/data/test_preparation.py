"""All meshes of a category at once."""

from __future__ import annotations

import itertools
import logging
import time

import numpy as np
import pytest
import trimesh
from mesh_files import put, source_of

from nbv.data.sources import prepare_meshes
from nbv.errors import UserError


@pytest.fixture
def root(tmp_path):
    for i in range(12):
        put(tmp_path / "mug" / f"m{i:02d}.ply", trimesh.creation.icosphere(subdivisions=i % 3))
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
    assert "mug: mesh 3 of 12" in caplog.text
    assert "mug: 12 meshes prepared" in caplog.text

"""Small data sets in each layout, and the settings that open them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from nbv.data.mesh_reader import MeshReader
from nbv.data.sources import open_source
from nbv.errors import UserError

REPOSITORY = Path(__file__).resolve().parents[2]
CONFIG = REPOSITORY / "config" / "dataset"
REAL = REPOSITORY.parent / "shared" / "data"

# Its process starts once, for all tests.
READER = MeshReader()

needs_real = pytest.mark.skipif(
    not REAL.is_dir(), reason=f"the real meshes are not there: {REAL} is no folder"
)


def settings_of(name, **changed):
    return {**yaml.safe_load((CONFIG / f"{name}.yaml").read_text()), **changed}


def source_of(name, seed=0, **changed):
    return open_source(settings_of(name, **changed), seed)


def pointer(towards=(0.0, 0.0, 1.0)):
    """A box with a small one before it: the farthest vertex from the middle shows where."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    towards = np.asarray(towards, float)
    spike = trimesh.creation.box((0.1, 0.1, 0.1))
    spike.apply_translation(towards)
    return trimesh.util.concatenate([box, spike])


def points_to(mesh):
    offset = np.asarray(mesh.vertices) - mesh.centroid
    farthest = offset[np.linalg.norm(offset, axis=1).argmax()]
    axis = np.abs(farthest).argmax()
    return ("-" if farthest[axis] < 0 else "+") + "xyz"[axis]


def put(path, mesh=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    (mesh or pointer()).export(path)
    return path


def refused(call, *named):
    with pytest.raises(UserError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for part in named:
        assert str(part) in message
    return message

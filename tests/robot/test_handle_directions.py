"""Where the handles of meshes are: `tools/handle_directions.py`."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nbv.core.angles import circular_distance_deg
from nbv.data.meshes import save_meshes
from nbv.data.normalisation import normalise
from nbv.data.procedural import generate

TOOL = Path(__file__).parents[2] / "tools/handle_directions.py"


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("handle_directions", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("turn_deg", [-100.0, -7.0, 0.0, 12.0])
def test_a_turned_handle_is_found(tool, turn_deg):
    for index in range(4):
        mug = generate("mug", 1, index, least_reach=0.2)
        found = tool.handle_deg(normalise(mug, "+z", "+x", turn_deg, "origin"))
        assert circular_distance_deg(found, turn_deg) < 0.5


def test_the_corners_of_a_square_body_are_no_handle(tool, tmp_path, capsys, monkeypatch):
    square = normalise(trimesh.creation.box((1.0, 1.0, 1.5)), "+z", "+x", 0.0, "origin")
    assert np.isnan(tool.handle_deg(square))
    mug = normalise(generate("mug", 1, 0, least_reach=0.2), "+z", "+x", 5.0, "origin")
    save_meshes(tmp_path / "mug.npz", {"b": mug, "a": square})
    monkeypatch.setattr("sys.argv", ["handle_directions.py", str(tmp_path / "mug.npz")])
    tool.main()
    header, first, second = capsys.readouterr().out.splitlines()
    assert (header, first) == ("object_id,handle_deg", "a,")
    assert float(second.removeprefix("b,")) == pytest.approx(5.0, abs=0.5)

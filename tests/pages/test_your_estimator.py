"""The page on one's own estimator: what its Python says of a 6-D pose."""

import re
import runpy
import textwrap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nbv.core.circle.angles import circular_distance_deg
from nbv.data.camera import Camera, object_views

PAGE = Path(__file__).parents[2] / "docs/your-estimator.md"


@pytest.fixture(scope="module")
def snippet(tmp_path_factory) -> str:
    text, *_ = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.M)
    path = tmp_path_factory.mktemp("page") / "snippet.py"
    path.write_text(text, "utf-8")
    return str(path)


def test_hypotheses_become_the_mixture_of_their_kernels(tmp_path):
    """A log-likelihood of 1 more is e times as likely."""
    (block,) = re.findall(
        r"\n\n((?:    .*\n)*    bins = .*\n(?:    .*\n)+)", PAGE.read_text("utf-8")
    )
    names = {"np": np, "azimuth_deg": np.array([40.0, 220.0]), "score": np.array([-1.0, -2.0])}
    (tmp_path / "snippet.py").write_text(textwrap.dedent(block), "utf-8")
    found = runpy.run_path(str(tmp_path / "snippet.py"), init_globals=names)["p"]
    assert found.sum() == pytest.approx(1)
    assert found.argmax() == 8
    assert found[8] / found[44] == pytest.approx(np.e)


@given(azimuth=st.floats(0, 359.99), elevation=st.floats(0, 80), seed=st.integers(0, 2**32 - 1))
def test_the_azimuth_of_a_pose_is_where_the_camera_was_put(snippet, azimuth, elevation, seed):
    """Whatever the axes of the mesh file are."""
    box = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])
    views = object_views(box, [[0, 1, 2]], elevation, [azimuth], Camera())
    of_file = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    # Optical frame: x right, y down, z forward.
    to_optical = np.stack([views.right[0], -views.up[0], views.forward[0]])
    names = {
        "np": np,
        "R": to_optical @ of_file.T,
        "t": -to_optical @ views.position[0],
        "up": of_file @ (0, 0, 1),
        "front": of_file @ (1, 0, 0),
    }
    found = runpy.run_path(snippet, init_globals=names)["azimuth_deg"]
    assert circular_distance_deg(found, azimuth) < 1e-3

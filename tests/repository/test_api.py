import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import nbv

SETTINGS = {"pose_likelihood": "given_estimate", "spread": "entropy"}


def evidence() -> nbv.Evidence:
    """Return what calibration makes of eight objects whose front and back are alike."""
    rng = np.random.default_rng(1)
    azimuth_deg = np.arange(0, 360, 10)
    flip_deg = 180 * rng.integers(0, 2, (8, len(azimuth_deg)))
    estimate_deg = (azimuth_deg + flip_deg * (np.cos(np.radians(azimuth_deg)) > 0.8)) % 360.0
    return nbv.gather_evidence(
        estimate_deg, SETTINGS, bandwidth_deg=8.0, pseudo_observations=1.0, n_bins=36
    )


@pytest.mark.parametrize("name", nbv.__all__)
def test_each_public_name_is_there(name):
    assert getattr(nbv, name).__name__ == name


def test_type_checkers_see_the_same_names():
    """`from nbv import Recommender` has a type, although nothing is imported before it is used."""
    imports = [
        node
        for node in ast.walk(ast.parse(Path(nbv.__file__).read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module.startswith("nbv.")
    ]
    seen = {name.asname: (node.module, name.name) for node in imports for name in node.names}
    assert set(seen) == set(nbv.__all__)
    for name, (module, of_module) in seen.items():
        assert getattr(import_module(module), of_module) is getattr(nbv, name)


@pytest.mark.parametrize(
    ("old", "new"), [("RotationPairs", "OrientationTable"), ("View", "PoseEstimate")]
)
def test_a_former_name_warns_of_the_new_name(old, new):
    with pytest.warns(DeprecationWarning, match=f"nbv.{old} is now nbv.{new}"):
        assert getattr(nbv, old) is getattr(nbv, new)


def test_the_former_function_warns_of_the_method():
    with pytest.warns(DeprecationWarning, match=r"is now nbv\.OrientationTable\.recommend"):
        assert callable(nbv.recommend_camera)


def test_all_public_names_are_listed():
    assert set(nbv.__all__) <= set(dir(nbv))


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = nbv.nothing


@pytest.mark.parametrize(
    ("use", "absent"),
    [
        ("", ("numpy", "pandas", "torch", "matplotlib")),
        ("nbv.LookupTable, nbv.average, nbv.posterior", ("pandas", "torch", "matplotlib")),
    ],
)
def test_what_a_robot_imports_stays_light(use, absent):
    code = f"import nbv, sys; {use}\nprint(*({set(absent)} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_the_public_api_goes_from_calibration_to_a_fused_pose(tmp_path):
    made = nbv.build_lookup(evidence(), "pose_ambiguity")
    made.save(tmp_path / "table.npz")
    table = nbv.LookupTable.load(tmp_path / "table.npz")
    np.testing.assert_array_equal(table.cost, made.cost)
    # The estimate 0° may be the front or the back; a view from the side tells them apart.
    delta_deg = table.recommend(0.0)
    assert abs(np.cos(np.radians(delta_deg))) < 0.8
    assert nbv.average(350.0, 10.0 + delta_deg, delta_deg) == pytest.approx(0.0)
    fused = nbv.posterior(0.0, (180.0 + delta_deg) % 360, delta_deg, evidence())
    assert fused == pytest.approx(180.0, abs=10.0)

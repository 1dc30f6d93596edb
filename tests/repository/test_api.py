import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import nbv


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

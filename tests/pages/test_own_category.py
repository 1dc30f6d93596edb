"""docs/own-category.md: its meshes can be made, and its command is a run of them."""

import re
import runpy
import shlex
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nbv.experiment.plan import Plan

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/own-category.md").read_text("utf-8")


def test_the_command_makes_a_bundle_of_the_meshes_that_the_snippet_writes(tmp_path):
    (snippet,) = re.findall(r"^```python\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    (tmp_path / "snippet.py").write_text(snippet, "utf-8")
    with chdir(tmp_path):
        runpy.run_path("snippet.py")
    (shown,) = re.findall(r"^    (snakemake .*?)\n\n", TEXT, re.DOTALL | re.MULTILINE)
    command = shlex.split(re.sub(r"^    ", "", shown, flags=re.MULTILINE).replace("\\\n", ""))
    overrides = [
        one.removeprefix("overrides=").replace("$PWD", str(tmp_path))
        for one in command[command.index("--config") + 1 :]
    ]
    given = [key for one in overrides for key in re.split(r",(?=[a-z_.]+=)", one.strip("[]"))]
    plan = Plan.load(ROOT / "config", tuple(given))
    plan.check_bundle("drill")
    files = sorted((tmp_path / "meshes/drill").iterdir())
    assert [path.stem for path in files] == list(plan.objects["drill"])
    for keys, values, _ in re.findall(r"^\| (`.+?) \| (.+?) \| (.+) \|$", TEXT, re.MULTILINE):
        for key, value in zip(keys.split(", "), values.split(", "), strict=True):
            assert key == "`dataset.root`" or f"{key}={value}".replace("`", "") in given
    # As the files have it, and as training varies it.
    usual_m, range_ = plan.config["sensor"]["diagonal_m"]["drill"], plan.config["randomisation"]
    mean_m = np.mean([trimesh.load_mesh(path, process=False).scale for path in files])
    assert mean_m == pytest.approx(usual_m, rel=range_["size"])

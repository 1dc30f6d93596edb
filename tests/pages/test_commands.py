"""The commands of the pages: those of `nbv` run, and those of make and Snakemake can be read."""

import re
import shlex
from contextlib import chdir
from itertools import count
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from examples.bop_example import write_example
from PIL import Image

import nbv
from nbv.cli import main
from nbv.experiment.config import load_config, snakemake_overrides

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "studies/README.md"]
PAGES += sorted((ROOT / "docs").glob("*.md"))
# docs/five-minutes.md and the drill of docs/own-category.md have tests of their own.
RUN = ("bundles", "camera", "own-category", "your-estimator")


def commands(path: Path, program: str) -> list[list[str]]:
    """Return the arguments of a program in a page's blocks and code, in their order."""
    text = path.read_text("utf-8").replace("\\\n", "")
    fence = re.compile(r"^```\w*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
    text = fence.sub(lambda block: re.sub("^", "    ", block[1], flags=re.MULTILINE), text)
    found = re.findall(rf"^    ({program} .*)$|`({program} [^`]+)`", text, re.MULTILINE)
    lines = [re.split(r"  +#| > | && | \.\.\.", first or other)[0] for first, other in found]
    return [shlex.split(line)[1:] for line in lines]


def write_frames() -> None:
    """Write the frames, masks, poses and manifest that the pages name."""
    frames = {name: nbv.example_frame(75.0) for name in ("frame", "first", "a")}
    frames |= {"second": nbv.example_frame(171.0), "b": nbv.example_frame(165.0)}
    for name, frame in frames.items():
        np.save(f"{name}.npy", frame.depth_m)
        Image.fromarray(np.round(1000 * frame.depth_m).astype(np.uint16)).save(f"{name}.png")
        Image.fromarray(255 * frame.mask.astype(np.uint8)).save(f"{name}_mask.png")
    camera = frames["frame"].intrinsics
    answer = nbv.Recommender.load("mug").recommend(frames["frame"].depth_m, intrinsics=camera)
    down = np.radians(frames["frame"].elevation_deg)
    pose = np.eye(4)
    pose[:3, 2] = np.cos(down), 0, -np.sin(down)
    pose[:3, 1] = -np.sin(down), 0, -np.cos(down)
    pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
    pose[:3, 3] = np.array([0.52, 0.10, 0.0]) - pose[:3, :3] @ answer.object_position_m
    np.savetxt("pose.txt", pose)
    azimuths_deg = np.arange(0.0, 360.0, 15.0)
    for place, azimuth_deg in enumerate(azimuths_deg):
        np.save(f"{place}.npy", nbv.example_frame(float(azimuth_deg)).depth_m)
    files = [f"{place}.npy" for place in range(len(azimuths_deg))]
    sweep = {"object_id": "mug1", "sequence": 1, "file": files, "azimuth_deg": azimuths_deg}
    pd.DataFrame(sweep).to_csv("manifest.csv", index=False)


def write_pairs(n_bins: int) -> None:
    """Write pairs of an estimator, with distributions of `n_bins` bins if that is not 0."""
    rng = np.random.default_rng(0)
    azimuth_deg = np.tile(np.arange(0.0, 360.0, 15.0), 20)
    estimate_deg = (azimuth_deg + rng.normal(0, 5, azimuth_deg.size)) % 360
    columns = {"object_id": np.repeat(np.arange(20), 24), "azimuth_deg": azimuth_deg}
    columns["estimate_deg"] = estimate_deg
    if n_bins:
        apart = np.radians(np.arange(n_bins) * 360 / n_bins - estimate_deg[:, None])
        weights = np.exp(20 * (np.cos(apart) - 1))
        names = [f"p{k}" for k in range(n_bins)]
        rows = pd.DataFrame(weights / weights.sum(axis=1, keepdims=True), columns=names)
        rows.iloc[[0, 6]].to_csv("views.csv", index=False)
        columns |= dict(rows.items())
    pd.DataFrame(columns).to_csv("pairs.csv", index=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("commands")
    with chdir(folder):
        write_frames()
    return folder


@pytest.mark.parametrize("name", RUN)
def test_the_commands_of_a_page_run(name, folder, capsys):
    listed = commands(ROOT / f"docs/{name}.md", "nbv")
    # `nbv evaluate` takes longer; tests/cli runs it.
    listed = [one for one in listed if one[1:] and one[0] != "evaluate" and "drill" not in str(one)]
    n_pairs = count()
    with chdir(folder):
        for command in ("example", "FOLDER") if name == "your-estimator" else ():
            write_example(Path(command))
        for command in listed:
            if command[:2] == ["calibrate", "pairs.csv"]:
                write_pairs(24 * next(n_pairs))
            assert main(command) == 0, (command, capsys.readouterr().err)
    assert len(listed) > 1


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_settings_and_targets_that_a_page_gives_exist(path):
    phony = re.search(r"^\.PHONY: ((?:.*\\\n)*.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    for command in commands(path, "make"):
        assert {one for one in command if "=" not in one} <= {*phony[1].split(), "and"}
    rules = [*ROOT.glob("workflow/rules/*.smk"), *ROOT.glob("studies/rules/*.smk")]
    rules += [ROOT / "Snakefile", ROOT / "studies/Snakefile"]
    targets = {
        name for each in rules for name in re.findall(r"^rule (\w+):", each.read_text(), re.M)
    }
    for command in commands(path, "snakemake"):
        end = command.index("--config") if "--config" in command else len(command)
        settings = dict(one.split("=", 1) for one in command[end + 1 :])
        settings = {
            key: re.sub(r"<\w+>|\$PWD|\$\(.*\)", "x", value) for key, value in settings.items()
        }
        load_config(ROOT / "config", snakemake_overrides(settings))
        plain = re.sub(r"-\S+ ?(?:\d+|\S+/\S+|report.zip)?", "", " ".join(command[:end])).split()
        assert {one for one in plain if "/" not in one} <= targets

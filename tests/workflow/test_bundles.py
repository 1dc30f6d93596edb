"""Bundles by the real Snakefile, run small."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open

from nbv.bundles.bundle import Bundle
from nbv.bundles.recommender import Recommender
from nbv.cli import main
from nbv.data.meshes import load_meshes
from nbv.data.procedural import generate
from projects import TINY, Project, finished_project

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
NUMBER = r"\d+(\.\d)?"
CAMERA = (
    *TINY,
    "categories=[mug]",
    "elevations_deg.mug=[0,30]",
    "camera.image_side=32",
    "++estimator.n_classes=24",
    "++estimator.target_bandwidth_deg=10",
    "estimator.kind=classifier",
    "randomisation.size=0.1",
    "randomisation.elevation_deg=5",
    "randomisation.patches=1",
)
JUGS = (
    *CAMERA,
    "categories=[jug]",
    "++elevations_deg.jug=[0,30]",
    "++sensor.diagonal_m.jug=0.17",
    "dataset=folder",
    "dataset.root=meshes",
    "dataset.up=+z",
    "dataset.front=+x",
    "n_objects=null",
)


def write_jugs(folder: Path) -> None:
    """Write meshes of a user's category."""
    (folder / "meshes/jug").mkdir(parents=True)
    for number in range(8):
        mesh = generate("mug", 3, number, least_reach=0.3)
        mesh.export(folder / f"meshes/jug/jug-{number}.obj")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Project:
    return finished_project(
        tmp_path_factory, "bundles", "bundles", overrides=JUGS, prepare=write_jugs
    )


def test_an_edit_of_the_renderer_renders_a_bundles_images_again(made: Project) -> None:
    path = made.folder / "src/nbv/data/embree.py"
    text = path.read_text()
    path.write_text(text + "\n\nEDITED = True\n")
    jobs = made.would_run(*JUGS[len(TINY) :], targets=("bundles",))
    path.write_text(text)
    assert jobs["render_bundle"] == 2


def test_mugs_have_handles_that_stand_out_and_some_are_square(fresh: Project) -> None:
    shapes = ("dataset.handle_reach=0.3", "dataset.square_share=0.3")
    fresh.run("results/tiny/meshes/mug.npz", "--cores", "1", overrides=(*CAMERA, *shapes))
    meshes = load_meshes(fresh.results / "meshes/mug.npz").values()
    sides = [np.ptp(mesh.vertices, axis=0) for mesh in meshes]
    assert len(sides) > 3
    assert all(along / across >= 1.3 for across, along, _ in sides)
    # From the axis towards a corner that is away from the handle: of a circle sqrt(2).
    to_corner = [m.vertices[:, :2].sum(axis=1).max() / m.vertices[:, 0].max() for m in meshes]
    assert 0 < sum(each > 1.5 for each in to_corner) < len(to_corner)


def test_a_bundle_is_calibrated_by_objects_that_it_was_not_trained_on(made: Project) -> None:
    splits = pd.read_csv(made.results / "splits/jug.csv", dtype={"object_id": str})
    of_role = splits[splits["fold"] == 1].groupby("role")["object_id"].agg(set)
    with safe_open(made.results / "bundles/estimators/jug.safetensors", "np") as stored:
        seen = set(json.loads(stored.metadata()["nbv"])["trained_on"])
    assert {name.split("/")[0] for name in seen} == of_role["train"]
    bundle = Bundle.load(made.results / "bundles/jug.safetensors")
    assert set(bundle.object_ids) == of_role["calibration"]
    assert set(pd.read_csv(made.results / "bundles/jug.csv")["object_id"]) == of_role["test"]


def test_a_bundle_has_sweeps_at_every_elevation(made: Project) -> None:
    bundle = Bundle.load(made.results / "bundles/jug.safetensors")
    assert sorted(set(bundle.elevation_deg.tolist())) == [0.0, 30.0]
    assert bundle.distributions.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)


def test_calibration_distributions_are_those_of_the_network(made: Project) -> None:
    bundle = Bundle.load(made.results / "bundles/jug.safetensors")
    images = np.load(made.results / "bundles/depth/jug/el30.npy", mmap_mode="r")
    names = json.loads((made.results / "bundles/depth/jug/el30_objects.json").read_text())
    place = int(np.flatnonzero(bundle.elevation_deg == 30.0)[0])
    codes = images[names.index(bundle.object_ids[place]), ::15]
    found = Recommender(bundle).distributions(np.asarray(codes))
    assert bundle.distributions[place] == pytest.approx(found, rel=0.06, abs=1e-6)


def test_a_bundle_is_tested_on_a_view_every_15_degrees(made: Project) -> None:
    assert_tested_with_all(made, made.results / "bundles", "jug", ("00", "30"))


def assert_tested_with_all(
    made: Project, folder: Path, category: str, elevations: tuple[str, ...]
) -> None:
    """A bundle's errors of one view are those on the images of the bundle with all ingredients."""
    recommender = Recommender.load(folder / f"{category}.safetensors")
    found = pd.read_csv(folder / f"{category}.csv", dtype={"sequence": str})
    single = found[found["choice"] == "single"].set_index(["sequence", "object_id"])["mae_deg"]
    azimuth_deg = np.arange(24) * 15.0
    for elevation in elevations:
        depth = made.results / f"bundles/depth/{category}"
        images = np.load(depth / f"el{elevation}.npy", mmap_mode="r")
        names = json.loads((depth / f"el{elevation}_objects.json").read_text())
        for object_id, mae_deg in single[str(int(elevation))].items():
            beliefs = recommender.distributions(np.asarray(images[names.index(object_id), ::15]))
            poses = np.degrees(np.angle(beliefs @ np.exp(1j * np.radians(azimuth_deg)))) % 360
            apart = np.abs(poses - azimuth_deg)
            assert np.minimum(apart, 360 - apart).mean() == pytest.approx(mae_deg, abs=1e-3)


def test_a_run_ends_with_the_errors_of_its_bundle_as_the_page_shows_them(made: Project) -> None:
    (made.results / "bundles/jug.safetensors").unlink()
    said = made.run("--cores", "2", "bundles", overrides=JUGS).stderr
    page = (
        (ROOT / "docs/own-category.md").read_text("utf-8").replace("results/drill", "results/tiny")
    )
    (shown,) = re.findall(r"\n\n((?:    .*\n)*    use it: .*\n)", page)
    lines = re.sub(NUMBER, "#", shown.replace("drill.", "jug.")).replace("\n    ", "\n").strip()
    assert lines.count("\n") == 6
    assert lines in re.sub(NUMBER, "#", said)


def test_a_folder_of_meshes_becomes_a_bundle_that_answers(
    made, tmp_path, capsys, monkeypatch
) -> None:
    """The category is the user's, with its size."""
    path = made.results / "bundles/jug.safetensors"
    bundle = Bundle.load(path)
    assert bundle.category == "jug"
    assert set(bundle.object_ids) <= {f"jug-{number}" for number in range(8)}
    monkeypatch.chdir(tmp_path)
    mesh = str(made.folder / "meshes/jug/jug-0.obj")
    assert main(["render", mesh, "--output", "frame.npy", "--azimuth", "200"]) == 0
    capsys.readouterr()
    assert main(["recommend", "frame.npy", "--bundle", str(path), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert 0 <= answer["azimuth_deg"] < 360

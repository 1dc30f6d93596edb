"""Bundles without one part of the randomisation, by the studies' Snakefile, run small."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nbv.bundles.evaluation import evaluate
from nbv.bundles.recommender import Recommender
from nbv.bundles.recordings import read_manifest, run_network
from nbv.frames.depth_files import write_depth
from nbv.frames.synthetic import example_frame
from projects import STUDIES, Project

from ..test_bundles import CAMERA, assert_tested_with_all

pytestmark = pytest.mark.slow


def test_ingredients_are_left_out_of_training_and_not_of_the_test(fresh: Project) -> None:
    frames = fresh.folder / "frames"
    frames.mkdir()
    rows = []
    for azimuth_deg in range(0, 360, 45):
        write_depth(frames / f"{azimuth_deg}.npy", example_frame(azimuth_deg).depth_m)
        rows.append({"file": f"{azimuth_deg}.npy", "azimuth_deg": azimuth_deg})
    manifest = frames / "manifest.csv"
    pd.DataFrame(rows).assign(object_id="mug", sequence="1").to_csv(manifest, index=False)
    left_out = (
        *CAMERA,
        "elevations_deg.mug=[30]",
        "++bundles.ingredients.size.size=0",
        "++bundles.replicates=[0,2]",
        f"bundles.frames={manifest}",
    )
    fresh.run("--cores", "2", *STUDIES, "ingredients", overrides=left_out)
    table = pd.read_csv(fresh.results / "tables/ingredients.csv")
    assert table["without"].tolist() == ["nothing", "size"]
    folders = [
        [fresh.results / "bundles" / without / replicate for replicate in ("", "replicate2")]
        for without in ("", "without_size")
    ]
    (recording,) = read_manifest(manifest)
    single = []
    for folder in folders[0]:
        bundle = Recommender.load(folder / "mug.safetensors")
        seen = run_network(bundle, recording, None, None, lambda path, error: None)
        errors = evaluate(bundle.bundle, [seen], n_views=(2,)).set_index("choice")
        single.append(errors["mae_deg"]["single"])
    assert table["one_view_real"][0] == pytest.approx(np.mean(single), abs=1e-3)
    assert table["one_view_real_least"][0] == pytest.approx(min(single), abs=1e-3)
    maes = [np.mean([two_view_mae(folder) for folder in each]) for each in folders]
    assert table["two_views"][0] == pytest.approx(maes[0], abs=1e-3)
    assert table["two_views"][1] == pytest.approx(maes[1] - maes[0], abs=1e-3)
    networks = {folder: network_of(folder) for each in folders for folder in each}
    assert len(set(networks.values())) == len(networks)
    images = [np.load(each[0] / "depth/mug/el30.npy", mmap_mode="r") for each in folders]
    assert not np.array_equal(images[0], images[1])
    assert not (fresh.results / "bundles/replicate2/depth").exists()
    for folder in folders[1]:
        assert_tested_with_all(fresh, folder, "mug", ("30",))


def two_view_mae(folder: Path) -> float:
    rows = pd.read_csv(folder / "mug.csv")
    rows = rows[(rows["choice"] == "recommended") & (rows["n_views"] == 2)]
    return float(rows.groupby("object_id")["mae_deg"].mean().mean())


def network_of(folder: Path) -> bytes:
    return (folder / "estimators/mug.safetensors").read_bytes()

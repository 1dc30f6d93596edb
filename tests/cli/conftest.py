"""Folders in which commands run."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import POSE
from made_bundles import BINS, WIDTH, frame
from nbv.cli import main


@pytest.fixture
def here(tmp_path, monkeypatch, bundle_file) -> Path:
    """A folder with four frames, a mask, a pose, and the bundle."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "b.safetensors").write_bytes(bundle_file.read_bytes())
    for place in range(4):
        np.save(tmp_path / f"f{place}.npy", frame(place))
    np.save(tmp_path / "m.npy", frame(0) > 0)
    (tmp_path / "pose.json").write_text(json.dumps(POSE))
    return tmp_path


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory) -> Path:
    """A folder with pairs and their lookup table. Not to be changed."""
    folder = tmp_path_factory.mktemp("calibrated")
    rng = np.random.default_rng(0)
    views = np.arange(0, 360, 6)
    rows = [
        (name, view, round(float((view + rng.normal(0, 12)) % 360), 3))
        for name in "ab"
        for view in views
    ]
    table = pd.DataFrame(rows, columns=["object_id", "azimuth_deg", "estimate_deg"])
    table.to_csv(folder / "pairs.csv", index=False)
    main(["calibrate", str(folder / "pairs.csv"), "--output", str(folder / "t.npz")])
    return folder


@pytest.fixture
def pairs(here, calibrated) -> Path:
    return Path(shutil.copy(calibrated / "pairs.csv", here))


@pytest.fixture
def table(here, calibrated) -> Path:
    return Path(shutil.copy(calibrated / "t.npz", here))


@pytest.fixture
def manifest(here) -> Path:
    """A sweep of one object, with a frame every 15 degrees."""
    (here / "sweep").mkdir()
    rows = []
    for place in range(BINS):
        np.save(here / "sweep" / f"{place}.npy", frame(place))
        rows.append(("cup", "1", f"sweep/{place}.npy", place * WIDTH, 20.0))
    names = ["object_id", "sequence", "file", "azimuth_deg", "elevation_deg"]
    pd.DataFrame(rows, columns=names).to_csv(here / "manifest.csv", index=False)
    return here / "manifest.csv"

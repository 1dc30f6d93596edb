"""Estimators that start from others, by the real Snakefile, run small."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open

from nbv.experiment.estimation.features import SHIPPED
from nbv.files import sha256_of
from projects import TINY, Project, finished_project

from ..test_bundles import CAMERA

pytestmark = pytest.mark.slow


def overrides(*elevations: int) -> tuple[str, ...]:
    return ("estimator.warm_start=both", f"elevations_deg.mug=[{','.join(map(str, elevations))}]")


MORE = (
    *overrides(0, 60),
    "calibration=crossfit",
    "crossfit_epochs=1",
    "estimator=classifier",
    "estimator.n_classes=24",
)
TARGET = "results/tiny/estimates/mug/el60/fold1/test.csv"


@pytest.fixture(scope="module")
def warm(tmp_path_factory) -> Project:
    """What the cross-fitted estimates of one fold at 60° need."""
    return finished_project(tmp_path_factory, "warm", TARGET, overrides=(*TINY, *MORE))


def history(path: Path) -> dict:
    with safe_open(path, framework="np") as stored:
        return json.loads(stored.metadata()["nbv"])


def training_objects(results: Path, category: str, fold: int, without: str | None) -> set[str]:
    splits = pd.read_csv(results / f"splits/{category}.csv", dtype={"object_id": str})
    of_fold = splits[splits["fold"] == fold]
    roles = {"train", "part1", "part2"} - {without}
    return set(of_fold.loc[of_fold["role"].isin(roles), "object_id"])


def ancestors(path: Path) -> list[Path]:
    """What an estimator started from, what that started from, and so on."""
    found: list[Path] = []
    while (origin := history(path).get("started_from")) is not None:
        path = (path.parent / origin["path"]).resolve()
        assert hashlib.sha256(path.read_bytes()).hexdigest() == origin["sha256"]
        found.append(path)
    return found


@pytest.mark.parametrize("part", [None, "part1", "part2"])
def test_ancestors_have_seen_the_training_objects_and_no_others(warm, part):
    """Ancestors of an estimator that calibrates a part have seen none of that part."""
    name = "estimator" if part is None else f"without_{part}"
    estimators = warm.results / "estimators"
    own = {name: training_objects(warm.results, name, 1, part) for name in ("mug", "chair")}
    pretrained = estimators / f"pretrained/fold1/{name}.safetensors"
    assert ancestors(pretrained) == []
    assert set(history(pretrained)["trained_on"]) == {
        f"{category}/{each}" for category, ids in own.items() for each in ids
    }
    low, high = (estimators / f"mug/el{el}/fold1/{name}.safetensors" for el in ("00", "60"))
    assert ancestors(low) == [pretrained]
    assert ancestors(high) == [low, pretrained]
    assert set(history(low)["trained_on"]) == set(history(high)["trained_on"]) == own["mug"]


def test_one_estimator_can_be_asked_for_by_name_and_brings_what_it_starts_from(fresh):
    target = "results/tiny/estimators/mug/el15/fold2/estimator.safetensors"
    more = overrides(0, 15, 60)
    planned = fresh.would_run(*more, targets=(target,))
    assert planned == {"meshes": 2, "render": 3, "splits": 2, "pretrain": 1, "train": 2}
    alone = fresh.would_run(more[1], "estimator.warm_start=elevations", targets=(target,))
    assert alone == {"meshes": 1, "render": 2, "splits": 1, "train": 2}


def test_a_changed_start_trains_what_follows_again(warm):
    """The settings of no stage can change unnoticed."""

    def planned(*more: str) -> dict[str, int]:
        return warm.would_run(*MORE, *more, targets=(TARGET,))

    made_again = {"train": 2, "train_part": 4, "estimate": 1}
    highest = {"train": 1, "train_part": 2, "estimate": 1}
    assert planned("estimator.next_elevation.learning_rate=1e-3") == highest
    assert planned("estimator.fine_tuning.learning_rate=1e-3") == made_again
    assert planned("estimator.pretraining.learning_rate=1e-3") == made_again | {
        "pretrain": 1,
        "pretrain_part": 2,
    }
    # From random weights.
    assert planned("estimator.warm_start=elevations") == made_again


def test_the_network_of_a_bundle_may_start_from_the_depth_features(fresh: Project) -> None:
    start = ("estimator.warm_start=features", "camera.image_side=64", "elevations_deg.mug=[0]")
    still = ("fine_tuning.epochs=1", "fine_tuning.learning_rate=1.0e-9", "weight_decay=0")
    settings = (*CAMERA, *start, *(f"estimator.{each}" for each in still))
    path = "results/tiny/bundles/estimators/mug.safetensors"
    fresh.run("--cores", "1", path, overrides=settings)
    with (
        safe_open(fresh.folder / path, framework="numpy") as made,
        safe_open(SHIPPED, "numpy") as own,
    ):
        assert json.loads(made.metadata()["nbv"])["started_from"]["sha256"] == sha256_of(SHIPPED)
        for name in ("0.0.weight", "2.weight"):
            features = own.get_tensor(name).astype(np.float32)
            assert made.get_tensor(name) == pytest.approx(features, abs=1e-3, rel=1e-2)

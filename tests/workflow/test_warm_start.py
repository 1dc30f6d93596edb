"""Estimators that start from others, by the real Snakefile, run small."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pandas as pd
import pytest
from safetensors import safe_open

from projects import TINY, Project, finished_project

pytestmark = pytest.mark.slow


def overrides(*elevations: int) -> tuple[str, ...]:
    return ("estimator.warm_start=both", f"elevations_deg.mug=[{','.join(map(str, elevations))}]")


MORE = overrides(0, 15, 60)


@pytest.fixture(scope="module")
def warm(tmp_path_factory) -> Project:
    """The estimators of two categories; mugs are seen from three elevations."""
    return finished_project(tmp_path_factory, "warm", "estimators", overrides=(*TINY, *MORE))


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


def check_fold(results: Path, fold: int, units: dict[str, tuple], part: str | None) -> None:
    """Check what each estimator of a fold, or of all parts but one, has seen and started from."""
    name = "estimator" if part is None else f"without_{part}"
    estimators = results / "estimators"
    own = {name: training_objects(results, name, fold, part) for name in ("mug", "chair")}
    pretrained = estimators / f"pretrained/fold{fold}/{name}.safetensors"
    assert ancestors(pretrained) == []
    assert set(history(pretrained)["trained_on"]) == {
        f"{category}/{each}" for category, ids in own.items() for each in ids
    }
    for category, of_category in units.items():
        chain = [
            estimators / f"{category}/el{elevation:02d}/fold{fold}/{name}.safetensors"
            for elevation in of_category
        ]
        for place, path in enumerate(chain):
            assert ancestors(path) == [*reversed(chain[:place]), pretrained]
            assert set(history(path)["trained_on"]) == own[category]


@pytest.mark.parametrize("fold", [1, 2])
def test_ancestors_have_seen_the_training_objects_and_no_others(warm, fold):
    check_fold(warm.results, fold, {"mug": (0, 15, 60), "chair": (0,)}, None)


def test_ancestors_of_a_classifier_of_some_parts_have_not_seen_the_others(fresh):
    target = "results/tiny/estimates/mug/el60/fold1/test.csv"
    crossfit = ("calibration=crossfit", "crossfit_epochs=1")
    classifier = ("estimator=classifier", "estimator.n_classes=24")
    fresh.run("--cores", "2", target, overrides=(*TINY, *overrides(0, 60), *crossfit, *classifier))
    # A lower elevation's parts are made for what starts from them.
    for part in (None, "part1", "part2"):
        check_fold(fresh.results, 1, {"mug": (0, 60)}, part)


def test_one_estimator_can_be_asked_for_by_name_and_brings_what_it_starts_from(fresh):
    target = "results/tiny/estimators/mug/el15/fold2/estimator.safetensors"
    planned = fresh.would_run(*MORE, targets=(target,))
    assert planned == {"meshes": 2, "render": 3, "splits": 2, "pretrain": 1, "train": 2}
    alone = fresh.would_run(MORE[1], "estimator.warm_start=elevations", targets=(target,))
    assert alone == {"meshes": 1, "render": 2, "splits": 1, "train": 2}


def test_a_changed_start_trains_what_follows_again(warm):
    """The settings of no stage can change unnoticed."""

    def planned(*more: str) -> dict[str, int]:
        return warm.would_run(*more, targets=("estimators",))

    made_again = {"train": 8, "estimators": 1}
    assert planned(*MORE, "estimator.epochs=2") == {}
    assert planned(*MORE, "estimator.next_elevation.epochs=2") == made_again | {"train": 4}
    assert planned(*MORE, "estimator.fine_tuning.epochs=2") == made_again
    assert planned(*MORE, "estimator.pretraining.epochs=1") == made_again | {"pretrain": 2}
    # From random weights.
    assert planned(*MORE[1:]) == made_again

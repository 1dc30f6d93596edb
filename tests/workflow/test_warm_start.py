"""Estimators that start from others, by the real Snakefile, run small."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pandas as pd
import pytest
from safetensors import safe_open

from projects import TINY

pytestmark = pytest.mark.slow

ELEVATIONS = (0, 15, 60)
MORE = ("estimator.warm_start=both", f"elevations_deg.mug={list(ELEVATIONS)}".replace(" ", ""))


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


@pytest.mark.parametrize("calibration", ["holdout", "crossfit"])
def test_ancestors_have_seen_the_training_objects_and_no_others(fresh, calibration):
    crossfit = ("calibration=crossfit", "crossfit_epochs=1") if calibration == "crossfit" else ()
    fresh.run("--cores", "2", "estimates", overrides=(*TINY, *MORE, *crossfit))
    estimators = fresh.results / "estimators"
    names = ["estimator"] + (["without_part1", "without_part2"] if crossfit else [])
    for fold in (1, 2):
        for name in names:
            part = name.removeprefix("without_") if name != "estimator" else None
            own = {
                category: training_objects(fresh.results, category, fold, part)
                for category in ("mug", "chair")
            }
            pretrained = estimators / f"pretrained/fold{fold}/{name}.safetensors"
            assert set(history(pretrained)["trained_on"]) == {
                f"{category}/{each}" for category, ids in own.items() for each in ids
            }
            for category, elevations in (("mug", ELEVATIONS), ("chair", (0,))):
                chain = [
                    estimators / f"{category}/el{elevation:02d}/fold{fold}/{name}.safetensors"
                    for elevation in elevations
                ]
                for place, path in enumerate(chain):
                    assert ancestors(path) == [*reversed(chain[:place]), pretrained]
                    assert set(history(path)["trained_on"]) == own[category]
    assert not list(estimators.rglob("fold3"))


def test_one_estimator_can_be_asked_for_by_name_and_brings_what_it_starts_from(fresh):
    target = "results/tiny/estimators/mug/el15/fold2/estimator.safetensors"
    planned = fresh.would_run(*MORE, targets=(target,))
    assert planned == {"meshes": 2, "render": 3, "splits": 2, "pretrain": 1, "train": 2}
    fresh.run(
        "--cores", "2", target, overrides=(*TINY, *MORE[1:], "estimator.warm_start=elevations")
    )
    made = sorted(
        str(path.relative_to(fresh.results / "estimators"))
        for path in (fresh.results / "estimators").rglob("*.safetensors")
    )
    assert made == [f"mug/el{e}/fold2/estimator.safetensors" for e in ("00", "15")]
    epochs = [history(fresh.results / "estimators" / name)["settings"]["epochs"] for name in made]
    assert epochs == [1, 4]


def test_a_changed_start_trains_what_follows_again(fresh):
    """Neither fine-tuning's settings nor another category's objects can go unnoticed."""
    fresh.run("--cores", "2", "estimators", overrides=(*TINY, *MORE))

    def planned(*more: str) -> dict[str, int]:
        return fresh.would_run(*more, targets=("estimators",))

    made_again = {"train": 8, "estimators": 1}
    assert planned(*MORE) == {}
    assert planned(*MORE, "estimator.epochs=2") == {}
    assert planned(*MORE, "estimator.fine_tuning.epochs=2") == made_again
    assert planned(*MORE, "estimator.pretraining.epochs=1") == made_again | {"pretrain": 2}
    # From random weights.
    assert planned(*MORE[1:]) == made_again

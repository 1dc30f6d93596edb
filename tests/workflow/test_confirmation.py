"""Several trainings and what they say together, by the real Snakefile, run small."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from safetensors import safe_open

from projects import STUDIES, TINY, Project, finished_project

pytestmark = pytest.mark.slow

N_CLASSES = 24
SMALL = (
    *TINY,
    "estimator=classifier",
    f"estimator.n_classes={N_CLASSES}",
    "estimator.warm_start=categories",
    "more_views.n_views=3",
    "more_views.start_every_deg=90",
    "confirmation.replicates=[[0],[0]]",
)
TABLES = ("methods", "contrasts", "beliefs", "densities")
TRAININGS = {(0, 0): "", (1, 0): "confirmation/shuffle1/replicate0/"}


@pytest.fixture(scope="module")
def confirmed(tmp_path_factory) -> Project:
    return finished_project(tmp_path_factory, "confirmed", *STUDIES, "confirm", overrides=SMALL)


def splits_of(project: Project, shuffle: int, category: str) -> pd.DataFrame:
    folder = "" if shuffle == 0 else f"confirmation/shuffle{shuffle}/"
    path = project.results / f"{folder}splits/{category}.csv"
    return pd.read_csv(path, dtype={"object_id": str})


def history(path: Path) -> dict:
    with safe_open(path, framework="np") as stored:
        return json.loads(stored.metadata()["nbv"])


@pytest.mark.parametrize("training", TRAININGS)
def test_every_training_has_seen_the_training_objects_of_its_own_folds(confirmed, training):
    estimators = confirmed.results / f"{TRAININGS[training]}estimators"
    seen = {}
    for category in ("mug", "chair"):
        splits = splits_of(confirmed, training[0], category)
        for fold in (1, 2):
            of_fold = splits[(splits["fold"] == fold) & (splits["role"] == "train")]
            seen[category, fold] = set(of_fold["object_id"])
            found = history(estimators / f"{category}/el00/fold{fold}/estimator.safetensors")
            assert set(found["trained_on"]) == seen[category, fold]
            start = found["started_from"]["path"]
            assert start.endswith(f"pretrained/fold{fold}/estimator.safetensors")
    for fold in (1, 2):
        found = history(estimators / f"pretrained/fold{fold}/estimator.safetensors")
        together = {
            f"{category}/{each}" for (category, k), ids in seen.items() if k == fold for each in ids
        }
        assert set(found["trained_on"]) == together


def test_a_shuffle_divides_the_same_objects_anew(confirmed):
    first, second = (splits_of(confirmed, shuffle, "mug") for shuffle in (0, 1))
    assert not first.equals(second)
    assert set(first["object_id"]) == set(second["object_id"])


def test_a_replicate_has_the_folds_of_its_shuffle_and_a_seed_of_its_own(confirmed):
    """Trained with one seed they would be the same, bit for bit."""
    place = "results/tiny/confirmation/shuffle0/replicate1/estimators/mug/el00/fold1"
    target = f"{place}/estimator.safetensors"
    confirmed.run("--cores", "2", *STUDIES, target, overrides=SMALL)
    own = confirmed.results / "estimators/mug/el00/fold1/estimator.safetensors"
    other = confirmed.folder / target
    assert history(other)["trained_on"] == history(own)["trained_on"]
    assert other.read_bytes() != own.read_bytes()


def test_the_tables_are_of_every_object_in_every_training(confirmed):
    folder = confirmed.results / "confirmation"
    means, contrasts = (pd.read_csv(folder / f"{name}.csv") for name in ("methods", "contrasts"))
    assert set(means["n_trainings"]) == set(contrasts["n_trainings"]) == {len(TRAININGS)}
    sizes = means.groupby("category")["n_objects"].unique()
    assert sizes.map(list).to_dict() == {"mug": [8], "chair": [8], "all": [16]}
    assert {"average", "posterior", "product"} <= set(means["fusion"])
    single = means[(means["category"] == "mug") & (means["choice"] == "none")].iloc[0]
    errors = []
    for place in TRAININGS.values():
        for fold in (1, 2):
            path = confirmed.results / f"{place}estimates/mug/el00/fold{fold}/test.csv"
            rows = pd.read_csv(path)
            rows = rows[rows["azimuth_deg"] % (360 // N_CLASSES) == 0]
            away = (rows["estimate_deg"] - rows["azimuth_deg"]).abs()
            errors.append(away.where(away <= 180, 360 - away))
    assert single["mae_deg"] == pytest.approx(pd.concat(errors).mean(), abs=0.01)
    beliefs = pd.read_csv(folder / "beliefs.csv")
    assert set(beliefs["n_views"]) == {1, 2, 3}
    assert set(beliefs["fusion"]) == {"posterior", "product"}
    text = (folder / "contrasts.md").read_text(encoding="utf-8")
    assert "Expected error less fixed" in text


def test_the_kept_file_alone_gives_the_same_tables(confirmed, fresh):
    kept = confirmed.results / "confirmation/estimates.npz"
    again = ("name=again", f"confirmation.kept=[{kept}]")
    done = fresh.run("--cores", "2", *STUDIES, "statistics", overrides=(*TINY[:-1], *again))
    # It makes no report.
    assert "read first" not in done.stderr
    made = fresh.folder / "results/again"
    assert not (made / "estimators").exists()
    tables = [f"{name}.{kind}" for name in TABLES for kind in ("csv", "md")]
    for name in (*tables, "trainings.csv"):
        before = (confirmed.results / "confirmation" / name).read_bytes()
        assert (made / "confirmation" / name).read_bytes() == before


def test_one_training_of_one_fold_can_be_asked_for_by_name(fresh):
    place = "results/tiny/confirmation/shuffle1/replicate2/estimators/mug/el00/fold2"
    planned = fresh.would_run(targets=(*STUDIES, f"{place}/estimator.safetensors"))
    assert planned == {"meshes": 1, "render": 1, "shuffle_splits": 1, "replicate_train": 1}

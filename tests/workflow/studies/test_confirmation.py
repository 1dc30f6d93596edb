"""Several trainings and what they say together, by the real Snakefile, run small."""

import itertools
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
    "more_views.n_views=3",
    "more_views.start_every_deg=90",
    "confirmation.replicates=[[0],[0]]",
)
TABLES = ("methods", "contrasts", "trainings", "beliefs", "densities")
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


def training_objects(project: Project, shuffle: int, category: str, fold: int) -> set[str]:
    splits = splits_of(project, shuffle, category)
    return set(splits.query("fold == @fold and role == 'train'")["object_id"])


@pytest.mark.parametrize("training", TRAININGS)
def test_every_training_has_seen_the_training_objects_of_its_own_folds(confirmed, training):
    estimators = confirmed.results / f"{TRAININGS[training]}estimators"
    for category, fold in itertools.product(("mug", "chair"), (1, 2)):
        found = history(estimators / f"{category}/el00/fold{fold}/estimator.safetensors")
        own = training_objects(confirmed, training[0], category, fold)
        assert set(found["trained_on"]) == own


def test_a_shuffle_divides_the_same_objects_anew(confirmed):
    first, second = (splits_of(confirmed, shuffle, "mug") for shuffle in (0, 1))
    assert not first.equals(second)
    assert set(first["object_id"]) == set(second["object_id"])


def test_a_replicate_has_the_folds_of_its_shuffle_and_a_seed_of_its_own(confirmed):
    """Trained with one seed they would be the same, bit for bit; so is what they start from."""
    folders = [f"results/tiny/confirmation/shuffle1/replicate{k}/estimators" for k in (1, 2)]
    targets = [f"{folder}/mug/el00/fold1/estimator.safetensors" for folder in folders]
    start = ("estimator.warm_start=categories",)
    confirmed.run("--cores", "2", *STUDIES, *targets, overrides=(*SMALL, *start))
    own = {name: training_objects(confirmed, 1, name, 1) for name in ("mug", "chair")}
    together = {f"{category}/{each}" for category, ids in own.items() for each in ids}
    trained = [confirmed.folder / target for target in targets]
    starts = [
        confirmed.folder / each / "pretrained/fold1/estimator.safetensors" for each in folders
    ]
    assert all(set(history(path)["trained_on"]) == own["mug"] for path in trained)
    assert all(set(history(path)["trained_on"]) == together for path in starts)
    assert len({path.read_bytes() for path in (*trained, *starts)}) == 4


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


def test_the_kept_file_alone_gives_the_same_tables(confirmed, fresh):
    kept = confirmed.results / "confirmation/estimates.npz"
    again = ("name=again", f"confirmation.kept=[{kept}]")
    done = fresh.run("--cores", "2", *STUDIES, "statistics", overrides=(*TINY[:-1], *again))
    # It makes no report.
    assert "read first" not in done.stderr
    made = fresh.folder / "results/again"
    assert not (made / "estimators").exists()
    for name in TABLES:
        before = (confirmed.results / f"confirmation/{name}.csv").read_bytes()
        assert (made / f"confirmation/{name}.csv").read_bytes() == before


def test_one_training_of_one_fold_can_be_asked_for_by_name(fresh):
    place = "results/tiny/confirmation/shuffle1/replicate2/estimators/mug/el00/fold2"
    planned = fresh.would_run(targets=(*STUDIES, f"{place}/estimator.safetensors"))
    assert planned == {"meshes": 1, "render": 1, "shuffle_splits": 1, "replicate_train": 1}

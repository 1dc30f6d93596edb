"""The whole experiment on estimates of another program, by the real Snakefile, run small."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.special import log_softmax

from nbv.cli import main
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.density import conditionals
from nbv.core.circle.distributions import mean_direction_deg
from nbv.core.circle.fusion import product
from nbv.core.circle.logits import fit_temperature
from nbv.core.circle.selection import DENSITY
from nbv.errors import UserError
from nbv.tables.lookup import LookupTable
from nbv.tables.pairs import PairTable
from projects import MUGS, STUDIES, TINY, Project, copy_of_project, finished_project

pytestmark = pytest.mark.slow

FOREIGN = (*MUGS, "estimator=external", "estimator.pairs=pairs.csv")


@pytest.fixture(scope="module")
def foreign(evaluated: Project, tmp_path_factory) -> Project:
    """A run on the tiny run's own test estimates, written as another program would."""

    def write_pairs(folder: Path) -> None:
        found = sorted((evaluated.results / "estimates/mug").rglob("test.csv"))
        table = pd.concat(pd.read_csv(path) for path in found)
        table.sample(frac=1.0, random_state=0).to_csv(folder / "pairs.csv", index=False)

    return finished_project(
        tmp_path_factory, "foreign", "evaluation", overrides=FOREIGN, prepare=write_pairs
    )


def errors_of(project: Project, method: str) -> pd.Series:
    files = sorted((project.results / "evaluation/mug").rglob(f"{method}.csv"))
    rows = pd.concat([pd.read_csv(path) for path in files])
    return rows.set_index(["object_id", "initial_deg"])["error_deg"].sort_index()


@pytest.mark.parametrize("method", ["single", "opposite"])
def test_methods_without_calibration_get_the_errors_of_the_run_itself(
    foreign, evaluated: Project, method: str
) -> None:
    found = errors_of(foreign, method)
    wanted = errors_of(evaluated, method)
    pd.testing.assert_series_equal(found, wanted)


def test_the_estimates_of_a_classifier_give_its_own_lookup_table(tmp_path, monkeypatch) -> None:
    """A file of pairs and ``nbv calibrate``: the table of the workflow, bit for bit."""
    project = copy_of_project(tmp_path)
    own = [one for one in TINY if not one.startswith(("density.", "name="))]
    own += [
        f"density.{key}={str(DENSITY[key]).replace(' ', '')}"
        for key in ("bandwidths_deg", "pseudo_observations", "n_parts")
    ]
    table = "results/classified/lookup/mug/el00/fold1/pose_ambiguity.npz"
    project.run(
        *("--cores", "2", table, "--notemp"),
        overrides=(*own, "n_objects=25", "estimator=classifier", "name=classified"),
    )
    estimates = project.folder / "results/classified/estimates/mug/el00/fold1/calibration.csv"
    rows = pd.read_csv(estimates, dtype=str)[["object_id", "azimuth_deg", "estimate_deg"]]
    assert rows["object_id"].nunique() > 5  # as many as the parts of the cross-validation
    shuffled = rows.groupby("object_id", sort=False).sample(frac=1.0, random_state=0)
    shuffled[rows.columns[::-1]].to_csv(tmp_path / "pairs.csv", index=False)
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", "pairs.csv", "--output", "foreign.npz"]) == 0
    assert Path("foreign.npz").read_bytes() == (project.folder / table).read_bytes()


def test_all_objects_that_are_not_tested_calibrate(foreign) -> None:
    splits = pd.read_csv(foreign.results / "splits/mug.csv", dtype={"object_id": str})
    assert set(splits["role"]) == {"calibration", "test"}
    of_fold = splits[splits["fold"] == 1].groupby("role")["object_id"].agg(set)
    table = LookupTable.load(foreign.results / "lookup/mug/el00/fold1/pose_ambiguity.npz")
    rows = pd.read_csv(foreign.folder / "pairs.csv", dtype={"object_id": str})
    rows = rows[rows["object_id"].isin(of_fold["calibration"])]
    wanted = conditionals(
        rows["estimate_deg"],
        rows["azimuth_deg"],
        bandwidth_deg=table.bandwidth_deg,
        pseudo_observations=table.pseudo_observations,
    )
    assert table.viewpoint_likelihood == pytest.approx(wanted.viewpoint, rel=1e-4, abs=1e-9)


def test_nothing_is_rendered_or_trained(foreign) -> None:
    present = {path.name for path in foreign.results.iterdir()}
    assert not present & {"meshes", "depth", "estimators"}
    jobs = foreign.would_run(*FOREIGN[len(TINY) :], "categories=[mug]")
    assert jobs["report"] == 1
    assert not jobs.keys() & {"meshes", "render", "train", "evaluate"}


def test_what_needs_images_or_trainings_is_refused_before_anything_runs(foreign) -> None:
    chosen = (*FOREIGN, "name=none")
    done = foreign.run(*STUDIES, "confirm", "--cores", "1", overrides=chosen, fails=True)
    (line,) = [one for one in done.stderr.splitlines() if one.startswith("nbv: error")]
    assert "estimator=external has no meshes, images or trainings" in line
    assert "Traceback" not in done.stderr
    assert not (foreign.folder / "results" / "none").exists()


N_CLASSES = 24


def foreign_distributions() -> pd.DataFrame:
    """Eight objects seen every 10°: blunt, sharper where the handle is seen, and too sure."""
    rng = np.random.default_rng(0)
    azimuth_deg, classes_deg = np.arange(0.0, 360.0, 10.0), np.arange(N_CLASSES) * 15.0
    tables = []
    for name in range(8):
        seen_deg = azimuth_deg + rng.normal(0.0, 12.0, len(azimuth_deg))
        sharpness = np.where(circular_distance_deg(azimuth_deg, 90.0) < 60.0, 4.0, 60.0)
        logits = sharpness[:, None] * np.cos(np.radians(classes_deg - seen_deg[:, None]))
        p = np.exp(log_softmax(logits, axis=1))
        table = pd.DataFrame(p, columns=[f"p{k}" for k in range(N_CLASSES)])
        table.insert(0, "object_id", f"mug-{name}")
        table.insert(1, "azimuth_deg", azimuth_deg)
        table.insert(2, "estimate_deg", mean_direction_deg(p))
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


DISTRIBUTIONS = (
    *MUGS,
    "estimator=external_distributions",
    f"estimator.n_classes={N_CLASSES}",
    "estimator.pairs=pairs.csv",
)


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> tuple[Project, pd.DataFrame]:
    """A run with extensions on distributions of another program."""
    table = foreign_distributions()
    shuffled = table.sample(frac=1.0, random_state=0)
    project = finished_project(
        tmp_path_factory,
        "distributions",
        *(*STUDIES, "evaluation", "leaderboard"),
        overrides=DISTRIBUTIONS,
        prepare=lambda folder: shuffled.to_csv(folder / "pairs.csv", index=False),
    )
    return project, table


@pytest.mark.parametrize("fold", [1, 2])
def test_distributions_of_another_program_are_fused_by_product(given, fold: int) -> None:
    """At the temperature of the fold's calibration objects, from views where there are some."""
    project, table = given
    splits = pd.read_csv(project.results / "splits/mug.csv", dtype={"object_id": str})
    roles = splits[splits["fold"] == fold].set_index("object_id")["role"]
    columns = [f"p{k}" for k in range(N_CLASSES)]
    calibration = table[table["object_id"].map(roles) == "calibration"]
    temperature = fit_temperature(
        np.log(calibration[columns].to_numpy()), calibration["azimuth_deg"].to_numpy()
    )
    assert temperature > 1.1
    place = f"mug/el00/fold{fold}"
    with np.load(project.results / "estimates" / place / "test_posteriors.npz") as stored:
        assert float(stored["temperature"]) == pytest.approx(temperature, rel=1e-4)
        name, kept = stored["object_ids"][0], stored["log_posterior"][0]
    logits = table.set_index(["object_id", "azimuth_deg"])[columns].map(np.log)
    # A view at 3 degrees is that at 0, turned by 3 degrees, a fifth of a class.
    nearest = np.exp(log_softmax(logits.loc[name, 0.0].to_numpy() / temperature))
    wanted_row = 0.8 * nearest + 0.2 * np.roll(nearest, 1)
    assert np.exp(kept[3]) == pytest.approx(wanted_row, abs=1e-4)
    evaluated = project.results / "evaluation" / place / "opposite_product.csv"
    rows = pd.read_csv(evaluated, dtype={"object_id": str}).set_index(["object_id", "initial_deg"])
    for (name, azimuth), own in logits.loc[list(roles[roles == "test"].index)].iterrows():
        other = logits.loc[name, (azimuth + 180.0) % 360.0]
        views = [np.exp(log_softmax(one.to_numpy() / temperature)) for one in (own, other)]
        wanted = circular_distance_deg(product(*views, 180.0), azimuth)
        assert rows.loc[(name, int(azimuth)), "error_deg"] == pytest.approx(wanted, abs=0.02)


def test_methods_of_distributions_are_in_the_tables(given) -> None:
    project, _ = given
    named = set(pd.read_csv(project.results / "tables/leaderboard.csv")["method"])
    assert {"single", "proposed", "error_product", "random_product", "selected"} <= named


@pytest.mark.parametrize(
    ("n_classes", "message"),
    [
        (72, "has 24 columns of probabilities (p0, p1, …), but estimator.n_classes=72: set it to"),
        (None, "choose estimator=external_distributions with estimator.n_classes=24"),
    ],
)
def test_the_number_of_classes_is_that_of_the_file(tmp_path, n_classes, message) -> None:
    path = tmp_path / "pairs.csv"
    foreign_distributions().to_csv(path, index=False)
    with pytest.raises(UserError, match=re.escape(message)):
        PairTable.load(path).check_classes(n_classes)

"""The whole experiment on estimates of another program, by the real Snakefile, run small."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from nbv.bundles.calibration import DENSITY
from nbv.calibration.density import conditionals
from nbv.cli import main
from nbv.recommendation.lookup import load_lookup
from projects import TINY, Project, copy_of_project

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def foreign(finished: Project, tmp_path_factory) -> tuple[Project, Path]:
    """A run on the tiny run's own test estimates, written as another program would."""
    folder = tmp_path_factory.mktemp("foreign")
    turns = []
    for category in ("mug", "chair"):
        for path in sorted((finished.results / "estimates" / category).rglob("test.csv")):
            turns.append(pd.read_csv(path).assign(category=category, elevation_deg=0))
    table = pd.concat(turns).sample(frac=1.0, random_state=0)
    table.to_csv(folder / "pairs.csv", index=False)
    project = copy_of_project(folder)
    chosen = (*TINY, "estimator=external", f"estimator.pairs={folder / 'pairs.csv'}")
    project.run("--cores", "2", overrides=chosen)
    return project, folder / "pairs.csv"


def errors_of(project: Project, category: str, method: str) -> pd.Series:
    files = sorted((project.results / "evaluation" / category).rglob(f"{method}.csv"))
    rows = pd.concat([pd.read_csv(path) for path in files])
    return rows.set_index(["object_id", "initial_deg"])["error_deg"].sort_index()


@pytest.mark.parametrize("category", ["mug", "chair"])
@pytest.mark.parametrize("method", ["single", "opposite"])
def test_methods_without_calibration_get_the_errors_of_the_run_itself(
    foreign, finished: Project, category: str, method: str
) -> None:
    project, _ = foreign
    found = errors_of(project, category, method)
    wanted = errors_of(finished, category, method)
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
    project, pairs = foreign
    splits = pd.read_csv(project.results / "splits/mug.csv", dtype={"object_id": str})
    assert set(splits["role"]) == {"calibration", "test"}
    of_fold = splits[splits["fold"] == 1].groupby("role")["object_id"].agg(set)
    table = load_lookup(project.results / "lookup/mug/el00/fold1/pose_ambiguity.npz")
    rows = pd.read_csv(pairs, dtype={"object_id": str})
    rows = rows[(rows["category"] == "mug") & rows["object_id"].isin(of_fold["calibration"])]
    wanted = conditionals(
        rows["estimate_deg"],
        rows["azimuth_deg"],
        bandwidth_deg=table.bandwidth_deg,
        pseudo_observations=table.pseudo_observations,
    )
    assert table.viewpoint_likelihood == pytest.approx(wanted.viewpoint, rel=1e-4, abs=1e-9)


def test_nothing_is_rendered_or_trained(foreign) -> None:
    project, pairs = foreign
    present = {path.name for path in project.results.iterdir()}
    assert not present & {"meshes", "depth", "estimators"}
    report = (project.results / "report.html").read_text()
    assert f"of another program, from {pairs}" in report
    assert "figure9.png" in {path.name for path in (project.results / "figures").iterdir()}


@pytest.mark.parametrize("target", ["confirm", "statistics", "estimators", "bundles"])
def test_what_needs_images_or_trainings_is_refused_before_anything_runs(foreign, target) -> None:
    project, pairs = foreign
    chosen = (*TINY, "estimator=external", f"estimator.pairs={pairs}", "name=none")
    done = project.run(target, "--cores", "1", overrides=chosen, fails=True)
    (line,) = [one for one in done.stderr.splitlines() if one.startswith("nbv: error")]
    assert "estimator=external has no meshes, images or trainings" in line
    assert "Traceback" not in done.stderr
    assert not (project.folder / "results" / "none").exists()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["object_id", "azimuth_deg", "estimate_deg"], "no column 'category', and the run has 2"),
        (["category", "azimuth_deg", "estimate_deg"], "no column 'object_id'"),
    ],
)
def test_a_file_that_does_not_fit_is_one_line(foreign, columns, message) -> None:
    project, pairs = foreign
    other = pairs.with_name("other.csv")
    pd.read_csv(pairs)[columns].to_csv(other, index=False)
    chosen = (*TINY, "estimator=external", f"estimator.pairs={other}", "name=other")
    done = project.run("--cores", "1", overrides=chosen, fails=True)
    (line,) = [one for one in done.stderr.splitlines() if one.startswith("nbv: error")]
    assert message in line

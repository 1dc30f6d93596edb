"""The real Snakefile, run small: what it writes, and what it makes again."""

import numpy as np
import pandas as pd
import pytest
from studies.ablation import ablation_space

from projects import STUDIES

pytestmark = pytest.mark.slow

EVALUATED = ["single", "random", "opposite", "proposed"]
SHOWN = {"table": 7, "figure": 11, "claims": 1, "runtime": 1, "report": 1}


def test_every_file_is_there_with_its_columns(finished):
    results = finished.results
    for category in ("mug", "chair"):
        splits = pd.read_csv(results / "splits" / f"{category}.csv")
        assert list(splits.columns) == ["object_id", "fold", "role"]
        depth = np.load(results / "depth" / category / "el00.npy", mmap_mode="r")
        assert depth.shape == (8, 360, 16, 16)
        assert depth.dtype == np.uint8
        for fold in (1, 2):
            place = f"{category}/el00/fold{fold}"
            assert (results / "estimators" / place / "estimator.safetensors").is_file()
            for role in ("calibration", "test"):
                estimates = pd.read_csv(results / "estimates" / place / f"{role}.csv")
                assert list(estimates.columns) == ["object_id", "azimuth_deg", "estimate_deg"]
            with np.load(results / "lookup" / place / "pose_ambiguity.npz") as lookup:
                assert lookup["viewpoint_likelihood"].shape == (360, 360)
                assert lookup["estimate_likelihood"].shape == (360, 360)
                assert lookup["cost"].dtype == np.float32
                assert lookup["recommended_delta_deg"].shape == (360,)
                assert lookup["bandwidth_deg"] in (8.0, 20.0)
            for method in EVALUATED:
                rows = pd.read_csv(results / "evaluation" / place / f"{method}.csv")
                assert list(rows.columns) == [
                    "object_id",
                    "initial_deg",
                    "initial_estimate_deg",
                    "delta_deg",
                    "next_estimate_deg",
                    "pose_estimate_deg",
                    "error_deg",
                ]
                assert len(rows) == 4 * 360
                assert rows["delta_deg"].isna().all() == (method == "single")
    for number in range(1, 8):
        for kind in ("csv", "md", "tex"):
            assert (results / "tables" / f"table{number}.{kind}").stat().st_size > 0
    for name in (
        "steps",
        "figure2",
        "figure3",
        "figure5",
        "figure6",
        "figure7",
        "figure8",
        "figure9",
    ):
        assert (results / "figures" / f"{name}.png").stat().st_size > 5_000
        assert (results / "figures" / f"{name}.pdf").stat().st_size > 5_000
        assert "<svg" in (results / "figures" / f"{name}.svg").read_text()[:1000]
    for name in ("claims.csv", "configuration.yaml"):
        assert (results / name).stat().st_size > 0
    small = "This run is too small for its numbers to mean anything: 8 objects of"
    for name in ("report.html", "claims.md", *(f"tables/table{n}.md" for n in range(1, 8))):
        assert small in (results / name).read_text()


def test_a_finished_run_has_nothing_to_do_and_the_explorer_is_made_of_what_it_has(finished):
    assert finished.would_run(targets=("all", "explorer")) == {"explorer": 1}


def test_another_bandwidth_and_an_object_less_rerun_what_follows(finished):
    """The lookups of both categories, and the images and trainings of the object's alone."""
    changed = ("density.bandwidths_deg=[11]", "dataset.exclude=[chair-0003]")
    assert finished.would_run(*changed) == {
        "meshes": 1,
        "render": 1,
        "splits": 1,
        "train": 2,
        "lookup": 4,
        "evaluate": 4,
        "settings": 1,
        **SHOWN,
    }


def test_another_training_length_reruns_training_and_what_follows(finished):
    """Also of another lookup table, of another unit; the figures that show it are planned too."""
    changed = ("estimator.epochs=2", "methods.proposed.policy=expected_error")
    assert finished.would_run(*changed) == {
        "train": 4,
        "lookup": 4,
        "evaluate": 4,
        "settings": 1,
        **SHOWN,
    }


def test_another_number_of_resamples_reruns_what_shows_intervals(finished):
    """An object and a size that no image of the run has rerun nothing else."""
    shown = {name: jobs for name, jobs in SHOWN.items() if name != "figure"}
    idle = ("dataset.exclude=[bottle-0003]", "sensor.diagonal_m.mug=0.3")
    assert finished.would_run("n_resamples=200", *idle) == {"settings": 1, **shown}


def test_an_edit_reruns_what_runs_that_code_and_what_follows(scratch):
    """A remark is no edit, and a fresh clone's sources are newer than what a run has kept."""
    metrics = scratch.folder / "src/nbv/experiment/statistics/metrics.py"
    criteria = scratch.folder / "src/nbv/core/circle/criteria.py"
    for source in scratch.folder.rglob("*.py"):
        source.touch()
    for name in ("src/nbv/data/pyrender.py", "Snakefile", "config/config.yaml"):
        path = scratch.folder / name
        path.write_text(path.read_text() + "\n# a remark\n")
    done = scratch.run("--cores", "1", "--dry-run")
    assert "Nothing to be done" in done.stdout + done.stderr
    metrics.write_text(metrics.read_text() + "\n\nEDITED = True\n")
    assert scratch.would_run() == {"settings": 1, **SHOWN}
    criteria.write_text(criteria.read_text() + "\n\nEDITED = True\n")
    assert scratch.would_run() == {
        "lookup": 4,
        "evaluate": 4,
        "settings": 1,
        **SHOWN,
    }


def test_proposed_without_a_lookup_table_plans_no_figure_of_one(fresh):
    jobs = fresh.would_run("methods={proposed: {policy: opposite}}")
    assert "lookup" not in jobs
    assert jobs["figure"] == 7


def test_the_studies_train_nothing_and_leave_the_run_alone(finished):
    """A new extension is in the run's settings; each setting of the ablation is a file."""
    jobs = finished.would_run(
        "extensions.mine={policy: bayes_error,fusion: average}",
        targets=(*STUDIES, "all", "extensions", "ablation"),
    )
    assert jobs == {
        "evaluate_extensions": 4,
        "evaluate_more_views": 4,
        "leaderboard": 1,
        "more_views": 1,
        "travel": 1,
        "extensions": 1,
        "evaluate_ablation": len(ablation_space()),
        "ablation": 1,
        "settings": 1,
        "runtime": 1,
        "report": 1,
    }

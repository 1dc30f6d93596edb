"""The real Snakefile, run small: what it writes, and what it makes again."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from snakemake.utils import Paramspace
from studies.ablation import ablation_space

from projects import STUDIES, TINY

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


def test_a_finished_run_has_nothing_to_do(finished):
    assert finished.would_run() == {}


def test_a_run_in_a_fresh_clone_whose_sources_are_newer_has_nothing_to_do(scratch):
    for source in scratch.folder.rglob("*.py"):
        source.touch()
    done = scratch.run("--cores", "1", "--dry-run")
    assert "Nothing to be done" in done.stdout + done.stderr


def test_another_bandwidth_reruns_lookups_and_what_follows(finished):
    assert finished.would_run("density.bandwidths_deg=[11]") == {
        "lookup": 4,
        "evaluate_recommended": 4,
        "settings": 1,
        **SHOWN,
    }


def test_another_training_length_reruns_training_and_what_follows(finished):
    assert finished.would_run("estimator.epochs=2") == {
        "train": 4,
        "lookup": 4,
        "evaluate_baselines": 4,
        "evaluate_recommended": 4,
        "settings": 1,
        **SHOWN,
    }


def test_another_number_of_resamples_reruns_what_shows_intervals(finished):
    shown = {name: jobs for name, jobs in SHOWN.items() if name != "figure"}
    assert finished.would_run("n_resamples=200") == {"settings": 1, **shown}


def test_leaving_out_an_object_changes_its_category_alone(finished):
    jobs = finished.would_run("dataset.exclude=[chair-0003]")
    assert (jobs["meshes"], jobs["train"]) == (1, 2)
    assert finished.would_run("dataset.exclude=[bottle-0003]") == {
        "settings": 1,
        "runtime": 1,
        "report": 1,
    }


def test_an_edit_reruns_what_runs_that_code_and_what_follows(scratch):
    metrics = scratch.folder / "src/nbv/experiment/statistics/metrics.py"
    criteria = scratch.folder / "src/nbv/core/criteria.py"
    metrics.touch()
    for name in ("src/nbv/data/pyrender.py", "Snakefile", "config/config.yaml"):
        path = scratch.folder / name
        path.write_text(path.read_text() + "\n# a remark\n")
    assert scratch.would_run() == {}
    metrics.write_text(metrics.read_text() + "\n\nEDITED = True\n")
    assert scratch.would_run() == {"settings": 1, **SHOWN}
    criteria.write_text(criteria.read_text() + "\n\nEDITED = True\n")
    assert scratch.would_run() == {
        "evaluate_baselines": 4,
        "lookup": 4,
        "evaluate_recommended": 4,
        "settings": 1,
        **SHOWN,
    }


def test_another_criterion_for_proposed_is_a_run_like_any_other(finished):
    """Its lookup table has another name and unit; the figures that show it are still planned."""
    jobs = finished.would_run("methods.proposed.policy=expected_error")
    assert (jobs["lookup"], jobs["figure"]) == (4, 11)


def test_proposed_without_a_lookup_table_plans_no_figure_of_one(fresh):
    jobs = fresh.would_run("methods={proposed: {policy: opposite}}")
    assert "lookup" not in jobs
    assert jobs["figure"] == 7


def test_the_explorer_is_made_on_request_of_what_a_finished_run_has(finished):
    assert finished.would_run(targets=("explorer",)) == {"explorer": 1}


def test_the_studies_find_the_run_finished_too(finished):
    assert finished.would_run(targets=(*STUDIES, "all")) == {}


def test_extensions_are_made_and_leave_the_paper_alone(scratch):
    targets = (*STUDIES, "extensions")
    assert not {"meshes", "render", "train"} & set(scratch.would_run(targets=targets))
    before = scratch.outcome()
    scratch.run("--cores", "2", *targets, overrides=(*TINY, "categories=[mug]"))
    after = scratch.outcome()
    assert {name: after[name] for name in before} == before
    tables = scratch.results / "tables"
    for name in ("leaderboard", "more_views"):
        for kind in ("csv", "md", "tex"):
            assert (tables / f"{name}.{kind}").stat().st_size > 100
    for name in ("more_views", "travel"):
        assert (scratch.results / f"figures/{name}.png").stat().st_size > 1000
    board = pd.read_csv(tables / "leaderboard.csv")
    assert {"single", "proposed", "selected", "oracle_posterior"} <= set(board["method"])
    (mine,) = board.loc[board["method"] == "proposed", "value"]
    found = scratch.results.glob("evaluation/mug/el00/*/proposed.csv")
    errors = pd.concat(pd.read_csv(path) for path in found)
    assert abs(mine - errors["error_deg"].mean()) < 1e-3


def test_a_new_extension_trains_nothing(finished):
    jobs = finished.would_run(
        "extensions.mine={policy: bayes_error,fusion: average}", targets=(*STUDIES, "leaderboard")
    )
    assert jobs == {"evaluate_extensions": 4, "leaderboard": 1}


def test_the_ablation_trains_nothing_and_each_of_its_settings_is_a_file(scratch):
    jobs = scratch.would_run(targets=(*STUDIES, "ablation"))
    assert jobs == {"evaluate_ablation": len(ablation_space()), "ablation": 1}
    patterns = Paramspace(ablation_space(), filename_params="*", filename_sep=",").instance_patterns
    target = f"results/tiny/ablation/{next(iter(patterns))}.csv"
    scratch.run("--cores", "1", *STUDIES, target)
    found = pd.read_csv(scratch.folder / target)
    plain = pd.concat(
        pd.read_csv(path).assign(fold=fold)
        for fold in (1, 2)
        for path in scratch.results.glob(f"evaluation/mug/el00/fold{fold}/proposed.csv")
    )
    expected = plain.groupby(["fold", "object_id"])["error_deg"].mean().to_numpy()
    mine = found.sort_values(["fold", "object_id"])["error_deg"]
    assert abs(mine.to_numpy() - expected).max() < 1e-3

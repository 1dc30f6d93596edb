"""What a person who made a mistake reads: one clear line, before anything is spent."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest
import trimesh

from projects import ROOT, STUDIES, TINY

# Each starts Snakemake.
pytestmark = pytest.mark.slow
FOLDER = "dataset=folder"


def complaints(printed: str) -> int:
    """Count our own lines, after asserting that there is nothing worse among them."""
    assert "Traceback" not in printed
    assert "Error in" not in printed
    return sum(line.startswith("nbv: error: ") for line in printed.splitlines())


def write_meshes(folder, n: int) -> None:
    folder.mkdir(parents=True)
    for index in range(n):
        trimesh.creation.box((1, 2, 3 + index)).export(folder / f"{index}.ply")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("estimator.epocs=3", "did you mean 'estimator.epochs'?"),
        ("renderer=foo", "renderer=foo is unknown: choose from: embree, pyrender"),
        ("categories=[mgu]", "did you mean 'mug'?"),
        ("methods.proposed.policy=pose_ambigity", "methods.proposed: policy 'pose_ambigity' is"),
        ("estimator.epochs=three", "estimator.epochs=three: input should be a valid integer"),
        (
            "density.bandwidths_deg=[8,nan]",
            "density.bandwidths_deg[1]=nan: input should be a finite",
        ),
        ("categories=[mug/../../../../x]", "categories[0]=mug/../../../../x: use letters"),
    ],
)
def test_a_wrong_setting(fresh, override, message):
    done = fresh.run("--cores", "1", overrides=(*TINY, override), fails=True)
    assert message in done.stderr
    assert complaints(done.stderr) == 1
    assert not fresh.results.exists()


@pytest.mark.parametrize("name", ["..", "n" * 300])
def test_a_name_that_leads_elsewhere_writes_nothing(fresh, name):
    before = sorted(fresh.folder.rglob("*"))
    done = fresh.run("--cores", "1", overrides=(*TINY, f"name={name}"), fails=True)
    assert "nbv: error: name=" in done.stderr
    assert complaints(done.stderr) == 1
    written = set(fresh.folder.rglob("*")) - set(before)
    assert {path.relative_to(fresh.folder).parts[0] for path in written} <= {".snakemake", "src"}


def test_overrides_that_are_no_list(fresh):
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--config", "overrides=5"]
    done = subprocess.run(
        command, cwd=fresh.folder, env=fresh.environment, capture_output=True, text=True
    )
    assert done.returncode != 0
    assert "nbv: error: --config overrides=5: write it as overrides=" in done.stderr
    assert complaints(done.stderr) == 1


@pytest.mark.parametrize(
    ("target", "key", "content", "message"),
    [
        ("runs", "compared_runs", b"\x89PNG\r\n\x1a\n", "cannot be read as YAML"),
        ("leaderboard", "leaderboard_runs", b"n_folds: 5\n", "categories is missing"),
    ],
)
def test_a_damaged_configuration_of_another_run(fresh, target, key, content, message):
    path = fresh.results.with_name("other") / "configuration.yaml"
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    settings = (*TINY, f"{key}=[other]")
    done = fresh.run("--cores", "1", *STUDIES, target, overrides=settings, fails=True)
    assert "nbv: error: results/other/configuration.yaml" in done.stderr
    assert message in done.stderr
    assert complaints(done.stderr) == 1


def test_another_criterion_for_proposed_is_a_run_like_any_other(fresh):
    """Its lookup table has another name and unit; the figures that show it are still planned."""
    jobs = fresh.would_run("methods.proposed.policy=expected_error")
    assert (jobs["lookup"], jobs["figure"]) == (4, 11)


def test_proposed_without_a_lookup_table_plans_no_figure_of_one(fresh):
    jobs = fresh.would_run("methods={proposed: {policy: opposite}}")
    assert "lookup" not in jobs
    assert jobs["figure"] == 7


def test_a_root_that_does_not_exist(fresh):
    settings = (*TINY, FOLDER, "dataset.root=nowhere")
    done = fresh.run("--cores", "1", overrides=settings, fails=True)
    assert "nowhere does not exist" in done.stderr
    assert complaints(done.stderr) == 1


def test_too_few_meshes(fresh):
    write_meshes(fresh.folder / "things/mug", 3)
    settings = (*TINY, FOLDER, "dataset.root=things", "categories=[mug]", "n_objects=125")
    done = fresh.run("--cores", "1", overrides=settings, fails=True)
    assert "holds 3 usable meshes, n_objects=125 asked for" in done.stderr
    assert complaints(done.stderr) == 1


def test_too_few_meshes_left_after_an_earlier_run(fresh):
    write_meshes(fresh.folder / "things/mug", 8)
    (fresh.results / "meshes").mkdir(parents=True)
    (fresh.results / "meshes/mug.npz").touch()
    (fresh.folder / "without.txt").write_text("0\n1\n2\n")
    more = (FOLDER, "dataset.root=things", "dataset.exclude_file=without.txt", "categories=[mug]")
    done = fresh.run("--cores", "1", overrides=(*TINY, *more), fails=True)
    assert "holds 5 usable meshes, n_objects=8 asked for" in done.stderr


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("bad.obj", b"v 0 0 0\nv nan 1 0\nv 0 1 1\nf 1 2 3\n", "vertex 1 is not finite"),
        ("bad.ply", b"", "the file is empty"),
        ("bad.glb", None, "cannot be read as a mesh"),
    ],
)
def test_a_bad_file_stops_the_run_before_anything_is_rendered(fresh, name, content, message):
    folder = fresh.folder / "things/mug"
    write_meshes(folder, 5)
    if content is None:
        content = trimesh.creation.box().export(file_type="glb")[:300]
    (folder / name).write_bytes(content)
    settings = (*TINY, FOLDER, "dataset.root=things", "categories=[mug]", "n_objects=null")
    done = fresh.run("--cores", "2", overrides=settings, fails=True)
    last_words = done.stderr.split("nbv: stopped")[1]
    assert f"things/mug/{name}" in last_words
    assert message in last_words
    assert "Traceback" not in done.stderr
    assert not (fresh.results / "depth").exists()


def test_a_log_says_how_far_the_run_is_and_an_error_once_more_at_the_end(scratch):
    lookups = [f"results/tiny/lookup/mug/el00/fold{k}/pose_ambiguity.npz" for k in (1, 2)]
    arguments = ("--cores", "2", "--force", *lookups)
    before = scratch.outcome()
    done = scratch.run(*arguments)
    assert "1 of 2 steps (50%) done" in done.stderr
    assert "nbv: finished" in done.stderr
    assert scratch.outcome() == before

    damaged = scratch.results / "estimates/mug/el00/fold1/calibration.csv"
    times = damaged.stat()
    damaged.write_bytes(damaged.read_bytes().replace(b"mug", b"mgu", 1))
    os.utime(damaged, ns=(times.st_atime_ns, times.st_mtime_ns))
    done = scratch.run(*arguments, fails=True)
    error = "error: results/tiny/estimates/mug/el00/fold1/calibration.csv changed after it was"
    assert done.stderr.count(error) == 2
    assert done.stderr.index("nbv: stopped") < done.stderr.rindex(error)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("snakefile", [(), STUDIES])
def test_the_workflow_is_lint_clean(fresh, snakefile):
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", *snakefile, "--lint"],
        cwd=fresh.folder,
        env=fresh.environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_the_rules_are_formatted():
    snakefmt = shutil.which("snakefmt") or f"{sys.prefix}/bin/snakefmt"
    done = subprocess.run([snakefmt, "--check", "Snakefile", "workflow", "studies"], cwd=ROOT)
    assert done.returncode == 0

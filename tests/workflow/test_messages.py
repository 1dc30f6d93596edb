"""What a person who made a mistake reads: one clear line, before anything is spent."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest
import trimesh

from projects import ROOT, TINY

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
        ("methods.proposed.policy=pose_ambigity", "did you mean 'pose_ambiguity'?"),
        ("methods.proposed.rotation=opposite", "methods.proposed.policy"),
        ("contenders={}", "extensions"),
        ("estimator.epochs=three", "estimator.epochs=three is not a whole number"),
    ],
)
def test_a_wrong_setting(fresh, override, message):
    done = fresh.run("--cores", "1", overrides=(*TINY, override), fails=True)
    assert message in done.stderr
    assert complaints(done.stderr) == 1
    assert not fresh.results.exists()


def test_another_criterion_for_proposed_is_a_run_like_any_other(fresh):
    """Its lookup table has another name and unit; the figures that show it are still planned."""
    jobs = fresh.would_run("methods.proposed.policy=expected_error")
    assert (jobs["lookup"], jobs["figure"]) == (4, 10)


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


@pytest.mark.slow
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


def test_the_workflow_is_lint_clean(fresh):
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint"],
        cwd=fresh.folder,
        env=fresh.environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_the_rules_are_formatted():
    snakefmt = shutil.which("snakefmt") or f"{sys.prefix}/bin/snakefmt"
    done = subprocess.run([snakefmt, "--check", "Snakefile", "workflow"], cwd=ROOT)
    assert done.returncode == 0

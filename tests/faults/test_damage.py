"""A file of a run that changed after it was written is noticed, and is made again."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess

import pytest

from projects import TINY

KINDS = {
    "meshes": "meshes/mug.npz",
    "splits": "splits/mug.csv",
    "depth": "depth/mug/el00.npy",
    "objects": "depth/mug/el00_objects.json",
    "estimator": "estimators/mug/el00/fold1/estimator.safetensors",
    "calibration": "estimates/mug/el00/fold1/calibration.csv",
    "test": "estimates/mug/el00/fold1/test.csv",
    "lookup": "lookup/mug/el00/fold1/pose_ambiguity.npz",
    "evaluation": "evaluation/mug/el00/fold1/proposed.csv",
    "table_csv": "tables/table1.csv",
    "table_md": "tables/table1.md",
    "table_html": "tables/table1.html",
    "figure_png": "figures/figure5.png",
    "figure_pdf": "figures/figure5.pdf",
    "figure_svg": "figures/figure5.svg",
    "claims": "claims.csv",
    "configuration": "configuration.yaml",
    "provenance": "provenance.json",
    "report": "report.html",
}
# What a job of the workflow reads, and a file that needs it.
READ_FOR = {
    "meshes": "splits/mug.csv",
    "splits": "lookup/mug/el00/fold1/pose_ambiguity.npz",
    "depth": "estimates/mug/el00/fold1/test.csv",
    "objects": "estimates/mug/el00/fold1/test.csv",
    "calibration": "lookup/mug/el00/fold1/pose_ambiguity.npz",
    "test": "evaluation/mug/el00/fold1/proposed.csv",
    "lookup": "evaluation/mug/el00/fold1/proposed.csv",
    "evaluation": "tables/table1.csv",
    "table_html": "report.html",
    "figure_svg": "report.html",
    "claims": "report.html",
    "configuration": "report.html",
    "provenance": "report.html",
}


def flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGE = {
    "one bit flipped": flip,
    "cut short": lambda content: content[: len(content) // 2],
    "emptied": lambda content: b"",
}


def damage(path, change) -> None:
    """Change a file and keep the time at which it was last modified."""
    times = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.mark.slow
@pytest.mark.parametrize("change", DAMAGE.values(), ids=DAMAGE)
def test_verify_names_every_damaged_file_of_every_kind(scratch, change):
    for name in KINDS.values():
        damage(scratch.results / name, change)
    printed = scratch.run("verify", "--cores", "1", fails=True).stderr
    named = re.findall(r"results/tiny/(\S+) is not what was written", printed)
    assert sorted(named) == sorted(KINDS.values())
    assert f"{len(KINDS)} of " in printed
    assert "Traceback" not in printed


@pytest.mark.slow
def test_verify_says_what_makes_damaged_files_again(scratch):
    before = scratch.outcome()
    damage(scratch.results / KINDS["depth"], flip)
    damage(scratch.results / KINDS["claims"], flip)
    printed = scratch.run("verify", "--cores", "2", fails=True).stderr
    command = shlex.split(re.search(r"make them again: (snakemake .*)", printed)[1])
    again = [*scratch.command()[:3], *command[1:]]
    subprocess.run(again, cwd=scratch.folder, env=scratch.environment, check=True, timeout=600)
    assert scratch.outcome() == before
    assert "files are as written, 0 are missing" in scratch.run("verify", "--cores", "1").stderr


@pytest.mark.slow
@pytest.mark.parametrize("kind", READ_FOR)
def test_a_job_notices_what_it_reads(scratch, kind):
    damage(scratch.results / KINDS[kind], flip)
    for name in {READ_FOR[kind]}:
        (scratch.results / name).unlink()
    target = f"results/tiny/{READ_FOR[kind]}"
    printed = scratch.run(target, "--cores", "2", fails=True).stderr
    assert f"error: results/tiny/{KINDS[kind]} changed after it was written" in printed
    assert "Traceback" not in printed
    assert not (scratch.results / KINDS[kind]).exists()


@pytest.mark.slow
def test_a_training_notices_what_it_starts_from(scratch):
    damage(scratch.results / KINDS["estimator"], flip)
    chain = (*TINY, "elevations_deg.mug=[0,60]", "estimator.warm_start=elevations")
    target = "results/tiny/estimators/mug/el60/fold1/estimator.safetensors"
    printed = scratch.run(target, "--cores", "2", overrides=chain, fails=True).stderr
    assert f"error: results/tiny/{KINDS['estimator']} changed after it was written" in printed
    assert "Traceback" not in printed
    assert not (scratch.results / KINDS["estimator"]).exists()


@pytest.mark.slow
def test_a_damaged_estimator_is_trained_again_with_its_lost_estimates(scratch):
    before = scratch.outcome()
    whole = (scratch.results / KINDS["estimator"]).read_bytes()
    damage(scratch.results / KINDS["estimator"], flip)
    (scratch.results / KINDS["test"]).unlink()
    scratch.run(f"results/tiny/{KINDS['test']}", "--cores", "2")
    assert (scratch.results / KINDS["estimator"]).read_bytes() == whole
    assert scratch.outcome() == before


@pytest.mark.slow
def test_the_same_command_goes_on_from_damage(scratch):
    before = scratch.outcome()
    for kind in ("depth", "test", "figure_svg"):
        damage(scratch.results / KINDS[kind], flip)
    # So that there is something to do.
    (scratch.results / "report.html").unlink()
    shutil.rmtree(scratch.results / "evaluation/mug")
    shutil.rmtree(scratch.results / "estimators/mug")
    for _ in range(3):
        scratch.run("--cores", "2", fails=True)
    scratch.run("--cores", "2")
    assert scratch.outcome() == before

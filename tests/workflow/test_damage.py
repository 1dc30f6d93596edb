"""A file of a run that changed after it was written is noticed, and is made again."""

import itertools
import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ONE_OF_EACH_KIND = (
    "meshes/mug.npz",
    "splits/mug.csv",
    "depth/mug/el00.npy",
    "depth/mug/el00_objects.json",
    "estimators/mug/el00/fold1/estimator.safetensors",
    "estimates/mug/el00/fold1/calibration.csv",
    "estimates/mug/el00/fold1/test.csv",
    "lookup/mug/el00/fold1/pose_ambiguity.npz",
    "evaluation/mug/el00/fold1/proposed.csv",
    "tables/table1.csv",
    "tables/table1.md",
    "tables/table1.html",
    "figures/figure5.png",
    "figures/figure5.pdf",
    "figures/figure5.svg",
    "claims.csv",
    "configuration.yaml",
    "provenance.json",
    "report.html",
)


def flip_a_bit(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def cut_short(content: bytes) -> bytes:
    return content[: len(content) // 2]


def empty(content: bytes) -> bytes:
    return b""


def damage(path: Path, change=flip_a_bit) -> None:
    """Change a file and keep the time at which it was last modified."""
    times = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def test_verify_names_one_damaged_file_of_each_kind(scratch):
    changes = itertools.cycle((flip_a_bit, cut_short, empty))
    for name in ONE_OF_EACH_KIND:
        damage(scratch.results / name, next(changes))
    printed = scratch.run("verify", "--cores", "1", fails=True).stderr
    named = re.findall(r"results/tiny/(\S+) differs from its checksum", printed)
    assert sorted(named) == sorted(ONE_OF_EACH_KIND)
    assert f"{len(ONE_OF_EACH_KIND)} of " in printed
    assert "Traceback" not in printed


def test_verify_says_what_makes_damaged_files_again(scratch):
    before = scratch.outcome()
    for name in ("evaluation/mug/el00/fold1/proposed.csv", "claims.csv"):
        damage(scratch.results / name)
    printed = scratch.run("verify", "--cores", "2", fails=True).stderr
    command = shlex.split(re.search(r"make them again: (snakemake .*)", printed)[1])
    again = [*scratch.command()[:3], *command[1:]]
    subprocess.run(again, cwd=scratch.folder, env=scratch.environment, check=True, timeout=600)
    assert scratch.outcome() == before
    assert "files are as written, 0 are missing" in scratch.run("verify", "--cores", "1").stderr


def test_a_job_notices_what_it_reads_and_the_same_command_makes_it_again(scratch):
    """A damaged estimator, which no job reads, is trained again with its lost estimates."""
    before = scratch.outcome()
    read = "results/tiny/estimates/mug/el00/fold1/calibration.csv"
    damage(scratch.folder / read)
    target = "results/tiny/lookup/mug/el00/fold1/pose_ambiguity.npz"
    (scratch.folder / target).unlink()
    printed = scratch.run(target, "--cores", "2", fails=True).stderr
    assert f"error: {read} differs from its checksum" in printed
    assert "Traceback" not in printed
    assert not (scratch.folder / read).exists()
    damage(scratch.results / "estimators/mug/el00/fold2/estimator.safetensors")
    estimates = "results/tiny/estimates/mug/el00/fold2/test.csv"
    (scratch.folder / estimates).unlink()
    scratch.run(target, estimates, "--cores", "2")
    assert scratch.outcome() == before

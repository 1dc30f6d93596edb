from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from nbv.errors import UserError
from nbv.experiment.run import jobs

PATH = "results/tiny/estimates/mug/el00/fold1/test.csv"
CONTENT = b"object_id,azimuth_deg,estimate_deg\n" + bytes(range(256))


@pytest.fixture(autouse=True)
def written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / PATH
    path.parent.mkdir(parents=True)
    path.write_bytes(CONTENT)
    jobs.write_checksum(PATH)
    return path


def flipped(content):
    return content[:100] + bytes([content[100] ^ 1]) + content[101:]


def _is_refused(state):
    assert jobs.states_of_files("results/tiny")[PATH].startswith(state)
    with pytest.raises(UserError, match=f"{PATH} {state}.* 1 files in all"):
        jobs.need_intact("results/tiny")
    with pytest.raises(UserError, match=f"{PATH} {state}.* run the same command again"):
        jobs.check(PATH)


def test_what_was_written_is_read_again(written):
    jobs.check(PATH)
    assert jobs.states_of_files("results/tiny") == {PATH: "is as written"}
    assert written.read_bytes() == CONTENT


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum here")
def test_another_program_verifies_the_same_files(written, tmp_path):
    record = tmp_path / "results/tiny/checksums/estimates/mug/el00/fold1/test.csv.sha256"
    subprocess.run(["sha256sum", "--check", "--strict", record], check=True, cwd=tmp_path)


@pytest.mark.parametrize(
    "damage", [flipped, lambda content: content[:-1], lambda _: b"", lambda content: content + b"x"]
)
def test_damage_is_noticed_whatever_the_time_of_the_file_and_the_file_is_set_aside(written, damage):
    times = written.stat()
    written.write_bytes(damage(CONTENT))
    os.utime(written, ns=(times.st_atime_ns, times.st_mtime_ns))
    _is_refused("differs from its checksum")
    assert not written.exists()
    assert written.with_name("test.csv.damaged").read_bytes() == damage(CONTENT)
    assert jobs.states_of_files("results/tiny") == {PATH: "is missing"}
    jobs.need_intact("results/tiny")


def test_files_of_no_run_have_no_checksum(tmp_path):
    for path in ("src/nbv/files.py", "results/loose.csv", str(tmp_path / "elsewhere.csv")):
        jobs.write_checksum(path)
        jobs.check(path)
    assert jobs.states_of_files("results/tiny") == {PATH: "is as written"}


@pytest.mark.parametrize("content", [CONTENT, CONTENT[:50]])
@pytest.mark.parametrize(
    "record", [None, "", "00", f"{'x' * 64}  {PATH}\n", f"{'0' * 64}  b.csv\n"]
)
def test_a_file_without_a_sound_checksum_is_noticed_and_only_the_checksum_is_blamed(
    written, record, content
):
    written.write_bytes(content)
    checksum = written.parents[4] / f"checksums/{PATH.removeprefix('results/tiny/')}.sha256"
    checksum.unlink()
    if record is not None:
        checksum.write_text(record)
    _is_refused("has no checksum" if record is None else "has a checksum that is damaged")


def test_logs_and_hidden_files_need_no_checksum():
    for name in ("logs/a.log", "benchmarks/a.tsv", ".DS_Store", "tables/.a.partial.csv"):
        path = Path("results/tiny", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    assert jobs.states_of_files("results/tiny") == {PATH: "is as written"}

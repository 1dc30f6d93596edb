from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from nbv.errors import UserError
from nbv.experiment.run.jobs import begin_run, check_folders

# A run that starts a job through a shell, which outlives a killed run.
RUN = """
import subprocess, sys
from nbv.experiment.run.jobs import begin_run
begin_run("results/tiny")
if len(sys.argv) > 1:
    subprocess.run(["bash", "-c", f"{sys.executable} {sys.argv[1]}; true"])
print("begun", flush=True)
sys.stdin.read()
"""
JOB = """
import time
from pathlib import Path
from nbv.experiment.run.jobs import end_with_run
end_with_run(Path("results/tiny/logs"))
for beat in range(600):
    Path("next.txt").write_text(str(beat))
    Path("next.txt").replace("beat.txt")
    time.sleep(0.1)
"""


@pytest.fixture(autouse=True)
def environment():
    """A run that a test begins leaves nothing in the environment of later tests."""
    before = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(before)


def start_run(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", RUN, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_no_run_begins_beside_another_of_the_same_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    running = start_run()
    assert running.stdout.readline() == "begun\n"
    with pytest.raises(UserError, match="another run works on results/tiny: wait"):
        begin_run("results/tiny")
    begin_run("results/other")
    running.kill()
    running.communicate()
    begin_run("results/tiny")


@pytest.mark.slow
def test_a_job_ends_with_its_run_before_the_next_one_begins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("job.py").write_text(JOB)
    running, beat = start_run("job.py"), Path("beat.txt")
    for _ in range(200):
        if beat.exists():
            break
        time.sleep(0.1)
    time.sleep(1)
    assert int(beat.read_text()) > 0
    running.kill()
    running.communicate()
    time.sleep(1)
    begin_run("results/tiny")
    last = beat.read_text()
    time.sleep(1)
    assert beat.read_text() == last


@pytest.mark.parametrize("path", ["results", "results/tiny", ".snakemake"])
def test_a_file_where_a_folder_should_be_is_one_line(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    check_folders("results/tiny")
    Path(path).parent.mkdir(exist_ok=True)
    Path(path).write_text("")
    with pytest.raises(UserError, match=f"^{path} is not a folder"):
        check_folders("results/tiny")


def test_a_folder_that_another_user_made_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path(".snakemake").mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: Path(path).name != ".snakemake")
    with pytest.raises(UserError, match=f"{tmp_path}/.snakemake cannot be written: permission"):
        check_folders("results/tiny")


def test_a_copied_run_is_told_once_that_times_decide(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    begin_run("results/here")
    assert capsys.readouterr().err == ""
    shutil.copytree("results/here", "results/there")
    begin_run("results/there")
    (line,) = capsys.readouterr().err.splitlines()
    assert f"results/there is a copy of {tmp_path}/results/here" in line
    assert "--touch" in line

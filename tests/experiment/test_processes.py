from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nbv.errors import UserError
from nbv.experiment.jobs import check_results, hold_lock

HOLDER = """
import sys
from pathlib import Path
from nbv.experiment.jobs import hold_lock
held = hold_lock(Path(sys.argv[1]))
print(held is not None, flush=True)
sys.stdin.read()
"""


def test_locks_are_removed_only_when_no_run_is_alive(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, tmp_path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline().strip() == "True"
    (tmp_path / "locks").mkdir()
    lock = tmp_path / "locks" / "0.input.lock"
    lock.write_text("results/tiny/report.html\n")

    held = hold_lock(tmp_path)
    assert held is not None
    assert lock.exists()
    held.close()

    process.kill()
    process.communicate()
    held = hold_lock(tmp_path)
    assert held is not None
    assert not lock.exists()
    held.close()


@pytest.mark.parametrize("below", ["", "/.snakemake"])
def test_a_folder_that_cannot_be_written_is_one_line(tmp_path, below):
    (tmp_path / "file").write_text("")
    folder = Path(f"{tmp_path}/file{below}")
    with pytest.raises(UserError, match=f"{folder} cannot be written: "):
        hold_lock(folder)
    with pytest.raises(UserError, match=f"{tmp_path}/file is not a folder"):
        check_results(str(folder))


def test_what_another_user_made_in_the_folder_is_named(tmp_path, monkeypatch):
    (tmp_path / "locks").mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: Path(path).name != "locks")
    with pytest.raises(UserError, match=f"{tmp_path}/locks cannot be written: Permission denied"):
        hold_lock(tmp_path)


def test_a_copied_run_is_told_that_times_decide(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("results/own").mkdir(parents=True)
    check_results("results/own")
    Path("results/own/provenance.json").write_text("{}")
    check_results.cache_clear()
    check_results("results/own")
    (line,) = capsys.readouterr().err.splitlines()
    assert "results/own was not made in this folder" in line
    assert "--touch" in line

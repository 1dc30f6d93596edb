from __future__ import annotations

import subprocess
import sys

from nbv.experiment.jobs import hold_lock

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


def test_a_folder_that_cannot_be_written_has_no_lock(tmp_path):
    (tmp_path / "file").write_text("")
    assert hold_lock(tmp_path / "file" / ".snakemake") is None

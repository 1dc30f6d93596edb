from __future__ import annotations

import subprocess
import sys

from nbv.experiment.processes import hold_lock

HOLDER = """
import sys
from pathlib import Path
from nbv.experiment.processes import hold_lock
held, removed, others = hold_lock(Path(sys.argv[1]))
print(removed, flush=True)
sys.stdin.read()
"""


def holder(folder):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, folder],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    return process, process.stdout.readline().strip()


def test_locks_are_removed_only_when_no_run_is_alive(tmp_path):
    process, removed = holder(tmp_path)
    assert removed == "False"
    (tmp_path / "locks").mkdir()
    lock = tmp_path / "locks" / "0.input.lock"
    lock.write_text("results/tiny/report.html\n")

    held, removed, others = hold_lock(tmp_path)
    assert (held is not None, removed, others, lock.exists()) == (True, False, True, True)
    held.close()

    process.kill()
    process.communicate()
    held, removed, others = hold_lock(tmp_path)
    assert (removed, others, lock.exists()) == (True, False, False)
    second, removed = holder(tmp_path)
    assert removed == "False"
    second.communicate("")
    held.close()


def test_a_folder_that_cannot_be_written_has_no_lock(tmp_path):
    (tmp_path / "file").write_text("")
    assert hold_lock(tmp_path / "file" / ".snakemake") == (None, False, False)

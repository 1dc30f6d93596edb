"""The real Snakefile on a real SLURM of one node, with jobs and nodes that fail in mid-run."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .one_node import OneNode, missing, one_node, until

pytestmark = pytest.mark.skipif(missing() is not None, reason=str(missing()))

# Ask sooner and more often than on a cluster that others use as well.
COMMAND = ("--workflow-profile", "profiles/slurm", "--slurm-init-seconds-before-status-checks", "3")
RUN_S = 540


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[OneNode]:
    with one_node(tmp_path / "slurm") as started:
        yield started


class Diary:
    """What happened when; `make test-slurm` shows it."""

    def __init__(self) -> None:
        self.started = time.monotonic()

    def note(self, text: str) -> None:
        print(f"{time.monotonic() - self.started:6.1f} s  {text}", flush=True)


def in_training(cluster: OneNode, besides: set[int]) -> int:
    """Wait for a further job that has come to its training, and return its number."""
    found: set[int] = set()

    def is_there() -> bool:
        found.update(set(cluster.in_script("train_estimator")) - besides)
        return bool(found)

    until(is_there, "a job is in training")
    return min(found)


def test_a_cancelled_job_a_restarted_daemon_and_a_lost_node_leave_the_same_bytes(
    finished, fresh, cluster
):
    diary = Diary()
    with (fresh.folder / "printed").open("w") as printed:
        run = subprocess.Popen(
            fresh.command(*COMMAND),
            cwd=fresh.folder,
            env=cluster.environment | {"PYTHONPATH": str(fresh.folder / "src")},
            stdout=printed,
            stderr=printed,
        )
    try:
        cancelled = in_training(cluster, set())
        cluster.cancel(cancelled)
        until(lambda: cluster.jobs()[cancelled][0] == "CANCELLED", "the job is cancelled")
        diary.note(f"job {cancelled} cancelled in training")

        at_restart = in_training(cluster, {cancelled})
        cluster.restart_slurmd()
        diary.note(f"slurmd restarted with job {at_restart} in training")
        until(lambda: cluster.jobs()[at_restart][0] == "COMPLETED", "that job has ended")

        lost = in_training(cluster, {cancelled, at_restart})
        cluster.crash()
        diary.note(f"slurmd and all jobs killed with job {lost} in training; slurmd started")
        run.wait(timeout=RUN_S)
    finally:
        if run.poll() is None:
            run.send_signal(signal.SIGINT)
            run.wait(timeout=60)
    log = (fresh.folder / "printed").read_text()
    jobs = cluster.jobs()
    for job, (state, comment) in sorted(jobs.items()):
        diary.note(f"job {job} {state}, restarted by SLURM {cluster.restarts(job)}: {comment}")
    assert run.returncode == 0, log
    assert "nbv: finished" in log
    assert [job for job, (state, _) in jobs.items() if state != "COMPLETED"] == [cancelled]
    assert cluster.restarts(at_restart) == 0
    assert cluster.restarts(lost) > 0
    assert fresh.outcome() == finished.outcome()
    diary.note(f"all {len(fresh.outcome())} files byte identical with those of a local run")

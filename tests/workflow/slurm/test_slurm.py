"""The real Snakefile on a real SLURM of one node, with jobs and nodes that fail in mid-run."""

import logging
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from projects import TINY, copy_of_project

from .one_node import OneNode, missing, one_node, until

pytestmark = pytest.mark.skipif(missing() is not None, reason=str(missing()))

log = logging.getLogger(__name__)

# Ask sooner and more often than on a cluster that others use as well.
COMMAND = ("--workflow-profile", "profiles/slurm", "--slurm-init-seconds-before-status-checks", "3")
# A job of every group.
TARGETS = ("evaluation", "results/tiny/claims.md", "results/tiny/figures/figure2.png")
# Enough for a machine that has much else to do: a quiet one takes a tenth.
RUN_S = 1800
# Two folds are enough: one is cancelled, the node is lost below one, slurmd restarts below one.
# They train for some seconds, so that all this meets them there.
CHANGED = {"categories": "[mug]", "estimator.epochs": "150"}
LONGER = tuple(f"{key}={CHANGED.get(key, value)}" for key, value in (o.split("=") for o in TINY))


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[OneNode]:
    with one_node(tmp_path / "slurm") as started:
        yield started


def in_training(cluster: OneNode, known: set[int]) -> int:
    """Wait for a further job that has come to its training, and return its number."""
    found: set[int] = set()

    def is_there() -> bool:
        found.update(set(cluster.in_script("train_estimator")) - known)
        return bool(found)

    until(is_there, "a job is in training")
    return min(found)


def test_a_cancelled_job_a_restarted_daemon_and_a_lost_node_leave_the_same_bytes(
    fresh, cluster, tmp_path
):
    (tmp_path / "local").mkdir()
    local = copy_of_project(tmp_path / "local")
    here = subprocess.run(
        local.command("--cores", "2", *TARGETS, overrides=LONGER),
        cwd=local.folder,
        env=local.environment,
        capture_output=True,
        text=True,
        timeout=RUN_S,
    )
    assert here.returncode == 0, here.stderr
    with (fresh.folder / "printed").open("w") as printed:
        run = subprocess.Popen(
            fresh.command(*COMMAND, *TARGETS, overrides=LONGER),
            cwd=fresh.folder,
            env=cluster.environment | {"PYTHONPATH": str(fresh.folder / "src")},
            stdout=printed,
            stderr=printed,
        )
    try:
        cancelled = in_training(cluster, set())
        cluster.cancel(cancelled)
        until(lambda: cluster.jobs()[cancelled][0] == "CANCELLED", "the job is cancelled")
        log.info(f"job {cancelled} cancelled in training")

        lost = in_training(cluster, {cancelled})
        cluster.crash()
        log.info(f"slurmd and all jobs killed with job {lost} in training; slurmd started")

        # The lost job trains again, so that there is one.
        at_restart = in_training(cluster, {cancelled})
        restarts = cluster.restarts(at_restart)
        cluster.restart_slurmd()
        log.info(f"slurmd restarted with job {at_restart} in training")
        run.wait(timeout=RUN_S)
    finally:
        if run.poll() is None:
            run.send_signal(signal.SIGINT)
            run.wait(timeout=60)
    told = (fresh.folder / "printed").read_text()
    jobs = cluster.jobs()
    for job, (state, comment) in sorted(jobs.items()):
        log.info(f"job {job} {state}, restarted by SLURM {cluster.restarts(job)}: {comment}")
    assert run.returncode == 0, told
    assert "nbv: finished" in told
    assert [job for job, (state, _) in jobs.items() if state != "COMPLETED"] == [cancelled]
    assert cluster.restarts(lost) > 0
    assert cluster.restarts(at_restart) == restarts
    assert fresh.outcome() == local.outcome()
    log.info(f"all {len(fresh.outcome())} files byte identical with those of a local run")

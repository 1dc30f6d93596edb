"""After kills and on a full disk the same command goes on, to the same bytes."""

import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import time

import psutil
import pytest

from projects import TINY

pytestmark = pytest.mark.slow

COMMAND = ("--cores", "2")
ONE_CORE = ("--cores", "1")
# A job of every kind in one category, because a run is made many times.
TARGETS = (
    "evaluation",
    *(f"results/tiny/{name}" for name in ("claims.md", "tables/table1.md", "figures/figure2.png")),
)
SMALL = tuple("categories=[mug]" if "categories=" in one else one for one in TINY)


def start(project) -> subprocess.Popen[str]:
    return subprocess.Popen(
        project.command(*ONE_CORE, *TARGETS, overrides=SMALL),
        cwd=project.folder,
        env=project.environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # What a script starts in the background ignores Ctrl-C, and so would this.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def interrupt(running, rng) -> None:
    running.send_signal(signal.SIGINT)


def kill_snakemake(running, rng) -> None:
    running.kill()


def kill_group(running, rng) -> None:
    os.killpg(running.pid, signal.SIGKILL)


def kill_job(running, rng) -> None:
    """Kill a job that began its log, as the kernel does where memory runs out; wait for one."""
    while running.poll() is None:
        with contextlib.suppress(psutil.NoSuchProcess):
            below = psutil.Process(running.pid).children(recursive=True)
            logging = [
                process
                for process in below
                if any("/logs/" in file.path for file in process.open_files())
            ]
            if logging:
                rng.choice(logging).kill()
                return
        time.sleep(0.02)


SAID = {interrupt: "the same command goes on from there", kill_job: "killed from outside: "}


def test_a_run_that_was_stopped_goes_on_to_the_bytes_of_a_whole_one(fresh):
    """On one core, to what two cores made; no lock is in the way, and no orphan writes."""
    started = time.monotonic()
    fresh.run(*COMMAND, *TARGETS, overrides=SMALL)
    whole_s = time.monotonic() - started
    expected, rng = fresh.outcome(), random.Random(10)
    shutil.rmtree(fresh.results)
    stops = [interrupt, kill_snakemake, kill_group, kill_job]
    while stops:
        running = start(fresh)
        try:
            _, printed = running.communicate(timeout=rng.uniform(0.2, 0.5) * whole_s)
        except subprocess.TimeoutExpired:
            stop = stops[0]
            stop(running, rng)
            _, printed = running.communicate(timeout=120)
            if running.returncode != 0:
                assert SAID.get(stop, "") in printed
                stops.remove(stop)
        assert "--unlock" not in printed
        assert "Traceback" not in printed
        if running.returncode == 0:
            assert fresh.outcome() == expected
            shutil.rmtree(fresh.results)
    last = fresh.run(*ONE_CORE, *TARGETS, overrides=SMALL)
    assert re.search(r"\d+ of \d+ steps \(\d+%\) done", last.stderr)
    assert "nbv: finished" in last.stderr
    # Before the first job and after the last one.
    assert last.stderr.count("too small for its numbers to mean anything") == 2
    assert fresh.outcome() == expected
    assert not list(fresh.results.rglob("*.partial*"))
    fresh.run("verify", "--cores", "1", overrides=SMALL)


@pytest.fixture
def small_disk(fresh):
    """A function that gives the results a disk of some size, or another size to the same disk."""
    folder = fresh.folder / "results"
    folder.mkdir()
    mounted = False

    def resize(size: int) -> None:
        nonlocal mounted
        options = f"size={size}" + (",remount" if mounted else "")
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"cannot mount a disk here: {done.stderr.strip()}")
        mounted = True

    yield resize
    if mounted:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def test_a_disk_that_fills_early_and_late(finished, fresh, small_disk):
    other = ("tables/", "figures/", "claims.", "chair")
    whole = finished.outcome()
    expected = {name: data for name, data in whole.items() if not any(o in name for o in other)}
    pages = sum(-(-len(data) // 4096) for data in expected.values())
    stages = set()
    for percent in (20, 80):
        small_disk(pages * 4096 * percent // 100)
        printed = fresh.run(*COMMAND, "evaluation", overrides=SMALL, fails=True).stderr
        assert "no space left on the disk; free some and run the same command again" in printed
        assert "Traceback" not in printed
        stages |= set(re.findall(r"\d (\w+)[^\]\n]*\] error: \S+ no space", printed))
    assert len(stages) >= 2, stages
    small_disk(10 * pages * 4096)
    fresh.run(*COMMAND, "evaluation", overrides=SMALL)
    assert fresh.outcome() == expected

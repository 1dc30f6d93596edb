"""A job does not outlive its Snakemake, and a lock does not outlive the Snakemake that took it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO

import psutil

# An orphan works on for no longer than this while the next run works.
_SECONDS_BETWEEN_CHECKS = 0.5


def end_with_snakemake() -> None:
    """Let this process end soon after the Snakemake that started it; where there is none, not.

    A termination signal becomes an exception, so that a job removes its temporary file.
    """
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    starter, parent = _snakemake_above(), os.getppid()
    if starter is not None:
        threading.Thread(target=_watch, args=(starter, parent), daemon=True).start()


def _snakemake_above() -> psutil.Process | None:
    for process in psutil.Process().parents():
        with contextlib.suppress(psutil.Error):
            if _runs_snakemake(process.cmdline()):
                return process
    return None


def _runs_snakemake(arguments: Iterable[str]) -> bool:
    return any(Path(argument).name == "snakemake" for argument in arguments)


def _watch(starter: psutil.Process, parent: int) -> None:
    while os.getppid() == parent and _is_alive(starter):
        time.sleep(_SECONDS_BETWEEN_CHECKS)
    # Nobody waits for this job any more, and the next run starts another one.
    os._exit(1)


def _is_alive(process: psutil.Process) -> bool:
    try:
        return bool(process.is_running() and process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return False


def hold_lock(folder: Path) -> IO[bytes] | None:
    """Remove Snakemake's locks where the runs that took them are dead, and mark this one as alive.

    Snakemake's lock is a file, which a killed run leaves behind. Every run of this project also
    holds a lock of the operating system, which ends with its process: exclusive for a moment where
    no other run is alive, to remove those files; shared as long as it runs.

    Parameters
    ----------
    folder : Path
        ``.snakemake``.

    Returns
    -------
    file or None
        The lock, held until the file is closed. None where the folder cannot be written or its file
        system has no such locks; then nothing is removed.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = (folder / "nbv.lock").open("ab")
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for lock in (folder / "locks").glob("*.lock"):
                lock.unlink()
        fcntl.flock(held, fcntl.LOCK_SH)
    except OSError:
        return None
    return held

"""Every job of the workflow logs its progress, and an error ends it with one clear line.

A job reads nothing that changed after it was written, and does not outlive its workflow.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import logging
import os
import re
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nbv.errors import UserError
from nbv.experiment import checksums
from nbv.experiment.processes import end_with_snakemake

log = logging.getLogger(__name__)

_SECONDS_BETWEEN_MESSAGES = 60
_FINISHED, _FAILED, _STOPPED = "processor time", "error: ", "stopped"
LAST_ERROR = "last_error.txt"
"""In the folder of a run's logs: the line of the job that failed last."""
NO_SPACE = "no space left on the disk; free some and run the same command again"
_FOR_THE_USER: dict[int | None, str] = {
    errno.ENOSPC: NO_SPACE,
    errno.EDQUOT: "the disk quota is used up; free some and run the same command again",
    errno.EROFS: "cannot be written, the file system is read-only",
    errno.EACCES: "permission denied",
    errno.ENAMETOOLONG: "the name is too long for this file system",
}


@contextmanager
def job(snakemake: Any) -> Iterator[None]:
    """Log a job's progress to its log file; end it with one line on an error.

    The terminal gets warnings, errors, what is marked ``extra={"for_terminal": True}``, and of the
    progress one message a minute.

    The inputs are held to their checksums before, and the outputs get theirs after. A job whose
    Snakemake was killed ends as well.

    Parameters
    ----------
    snakemake : object
        What Snakemake gives a script. Rule and wildcards label each line, since several jobs run
        at a time. The traceback of an unexpected error goes to the log file alone. The error's one
        line goes to ``logs/last_error.txt`` too, which `why_stopped` reads.

    Raises
    ------
    SystemExit
        With status 1, after it has reported an error.
    """
    path = Path(snakemake.log[0])
    label = " ".join([snakemake.rule, "/".join(snakemake.wildcards)]).strip()
    _log_to(path, label)
    end_with_snakemake()
    # Imports make 200,000 objects and no garbage: the search for it took an eighth of their time.
    gc.set_threshold(100_000)
    # Figures need none, and an unknown one ends the import of matplotlib.
    os.environ.pop("MPLBACKEND", None)
    try:
        for file in snakemake.input:
            checksums.check(file)
        yield
        for file in snakemake.output:
            checksums.write_checksum(file)
    except UserError as error:
        _fail(f"{error}", path)
    except Exception as error:
        if (first := _first_for_the_user(error)) is not None:
            # An error from an open file names no file; only the job's own outputs are open.
            where = first.filename or next(iter(snakemake.output), path)
            _fail(f"{where}: {_FOR_THE_USER[first.errno]}", path)
        if not _is_lack_of_memory(error):
            _fail_unexpectedly(error, path)
        reason = " ".join(str(error).split())
        _fail(f"memory ran out ({reason}): use fewer --cores, or smaller settings", path)
    except BaseException:
        log.info(_STOPPED, extra={"log_only": True})
        raise
    else:
        # Snakemake's benchmark only samples it; `nbv.experiment.report.runtime` reads this line.
        log.info(f"{_FINISHED} %.2f s", sum(os.times()[:4]), extra={"log_only": True})


def why_stopped(
    logs: str | Path, since: float, snakemake_logs: Iterable[str | Path] = ()
) -> list[str]:
    """Return the lines that say why a run stopped; none where it was interrupted.

    Parameters
    ----------
    logs : path
        The folder of a run's logs, where a job that failed has left its error.
    since : float
        Seconds since 1970: older logs are of earlier runs.
    snakemake_logs : iterable of path
        Snakemake's own logs of this run. A job that had no time to begin its log is known to
        Snakemake alone.
    """
    last_error = Path(logs) / LAST_ERROR
    lines = last_error.read_text(encoding="utf-8").splitlines() if last_error.exists() else []
    told = "".join(Path(log).read_text(encoding="utf-8") for log in snakemake_logs)
    if not lines and os.strerror(errno.ENOSPC) in told:
        # Snakemake's own files are on the disk, too.
        lines = [f"{_FAILED}{Path(logs).parent}: {NO_SPACE}"]
    killed = _killed_jobs(Path(logs), since) or re.findall(
        r"(\w+)\.py' died with <Signals.SIGKILL", told
    )
    # A full disk ends logs in the middle, too.
    ended_by_itself = "returned non-zero exit status" in told and "died with <Signals" not in told
    if not killed or ended_by_itself:
        return lines
    return [
        *lines,
        f"{_FAILED}killed from outside: {', '.join(killed)}",
        "most often memory ran out: use fewer --cores, or smaller settings",
    ]


def _killed_jobs(logs: Path, since: float) -> list[str]:
    """Return the jobs whose logs end in the middle: they were killed without a word."""
    return [
        path.relative_to(logs).with_suffix("").as_posix()
        for path in sorted(logs.rglob("*.log"))
        if path.stat().st_mtime >= since and not _has_end(path)
    ]


def _has_end(path: Path) -> bool:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    ends = (f"] {end}" for end in (_FINISHED, _FAILED, _STOPPED))
    return any(end in line for end in ends for line in lines[-1:])


def _log_to(path: Path, label: str) -> None:
    to_terminal = logging.StreamHandler(sys.stderr)
    to_terminal.addFilter(_ForTerminal())
    _add_handler(to_terminal, label)
    # A full disk makes every write to the log fail; logging would print a traceback for each.
    logging.raiseExceptions = False
    for noisy in ("matplotlib", "fontTools", "trimesh", "OpenGL"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _add_handler(logging.FileHandler(path, mode="w", encoding="utf-8"), label)
    except OSError as error:
        reason = _FOR_THE_USER.get(error.errno, f"cannot be written ({error.strerror})")
        _fail(f"{path}: {reason}", path)


class _ForTerminal(logging.Filter):
    def __init__(self) -> None:
        super().__init__()
        self._last_shown_s = time.monotonic()

    def filter(self, record: logging.LogRecord) -> bool:
        if getattr(record, "log_only", False):
            return False
        is_important = record.levelno >= logging.WARNING or getattr(record, "for_terminal", False)
        if not is_important and time.monotonic() - self._last_shown_s < _SECONDS_BETWEEN_MESSAGES:
            return False
        self._last_shown_s = time.monotonic()
        return True


def _add_handler(handler: logging.Handler, label: str) -> None:
    handler.setFormatter(logging.Formatter(f"[%(asctime)s {label}] %(message)s", "%H:%M:%S"))
    logging.getLogger().addHandler(handler)
    logging.getLogger().setLevel(logging.INFO)


def _first_for_the_user(error: BaseException | None) -> OSError | None:
    """Return the error of the file system that an error is, or that it came of.

    A writer that tidies up on a full disk can fail once more, with an error of its own.
    """
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FOR_THE_USER:
            return error
        error = error.__cause__ or error.__context__
    return None


def _is_lack_of_memory(error: Exception) -> bool:
    # Torch, which is not imported here, raises a RuntimeError of its own.
    return isinstance(error, MemoryError) or any(
        words in str(error) for words in ("can't allocate memory", "out of memory")
    )


def _fail(message: str, log_file: Path) -> None:
    message = " ".join(message.splitlines())
    log.error("%s%s", _FAILED, message)
    logs = next((folder for folder in log_file.parents if folder.name == "logs"), log_file.parent)
    # A full disk may not even take this line; the terminal has it already.
    with contextlib.suppress(OSError):
        (logs / LAST_ERROR).write_text(f"{_FAILED}{message}\n", encoding="utf-8")
    raise SystemExit(1)


def _fail_unexpectedly(error: Exception, path: Path) -> None:
    log.error("traceback", exc_info=error, extra={"log_only": True})
    _fail(f"{type(error).__name__}: {error} (traceback in {path})", path)

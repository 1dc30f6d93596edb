"""Every job of the workflow logs its progress, and an error ends it with one clear line.

A job reads nothing that changed after it was written, and does not outlive its workflow.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import fcntl
import functools
import gc
import logging
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import IO, Any, Literal

import psutil

from nbv.errors import UserError
from nbv.files import sha256_of, write_text

log = logging.getLogger(__name__)

State = Literal[
    "is as written",
    "is missing",
    "differs from its checksum: one of them changed after it was written",
    "has no checksum, so a change would go unnoticed",
    "has a checksum that is damaged",
]

_SECONDS_BETWEEN_MESSAGES = 60
# An orphan works on for no longer than this while the next run works.
_SECONDS_BETWEEN_CHECKS = 0.5
_FINISHED, _FAILED, _STOPPED = "processor time", "error: ", "stopped"
_NOT_RESULTS = ("logs", "benchmarks", "checksums")
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

SOUND: tuple[State, ...] = ("is as written", "is missing")


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
    try:
        for file in snakemake.input:
            check(file)
        yield
        for file in snakemake.output:
            write_checksum(file)
    except UserError as error:
        read = [file for file in snakemake.input if _checksum_of(file)]
        names_one = any(file in f"{error}" for file in (*read, *snakemake.output))
        source = "" if names_one or not read else f" (this job read {', '.join(read[:3])})"
        _fail(f"{error}{source}", path)
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


def import_from(folder: Path) -> None:
    """Let this process, and the jobs that it starts, import the packages in a folder."""
    sys.path.insert(0, str(folder))
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(folder), before]))


@functools.cache
def check_results(results: str) -> None:
    """Check the folder of a run's results, and warn where Snakemake has no record of them.

    Raises
    ------
    UserError
        If a part of its path is a file.
    """
    for part in (Path(results), *Path(results).parents):
        if os.path.lexists(part) and not part.is_dir():
            raise UserError(f"{part} is not a folder, which a run needs there; move it away")
    made = f"{results}/provenance.json"
    record = base64.urlsafe_b64encode(made.encode()).decode()
    if Path(made).is_file() and not Path(".snakemake/metadata", record).is_file():
        sys.stderr.write(
            f"nbv: warning: {results} was not made in this folder, so the times of its files "
            "decide what runs again; for a copy of what this version made, run the same command "
            "with --touch --forceall first\n"
        )


def forget_last_error(results: str) -> None:
    """Begin a run with no error: the first thing that it writes.

    Raises
    ------
    UserError
        If the folder of its results cannot be written.
    """
    logs = Path(results, "logs")
    try:
        logs.mkdir(parents=True, exist_ok=True)
        (logs / LAST_ERROR).unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"{results} cannot be written: {error.strerror}") from error


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


def write_checksum(path: str) -> None:
    """Write the SHA-256 of a run's file, in the format of ``sha256sum``.

    Parameters
    ----------
    path : str
        Relative to the project's folder: ``results/<name>/…``. Other files have no checksum.
    """
    record = _checksum_of(path)
    if record is not None:
        write_text(record, f"{sha256_of(path)}  {path}\n")


def state_of(path: str) -> State:
    """Return whether a file is what it was when its checksum was written.

    Files that are of no run are as written.
    """
    record = _checksum_of(path)
    if not Path(path).is_file():
        return "is missing"
    if record is None:
        return "is as written"
    if not Path(record).is_file():
        return "has no checksum, so a change would go unnoticed"
    written = Path(record).read_text(encoding="ascii", errors="replace")
    if not re.fullmatch(rf"[0-9a-f]{{64}}  {re.escape(path)}\n", written):
        return "has a checksum that is damaged"
    if sha256_of(path) != written[:64]:
        return "differs from its checksum: one of them changed after it was written"
    return "is as written"


def check(path: str) -> None:
    """Set aside a file that is not known to be as written.

    Raises
    ------
    UserError
        Naming the file. It has the suffix ``.damaged`` now, and the same command makes it again.
    """
    state = state_of(path)
    if state in SOUND:
        return
    # Another job may have found it at the same time, and moved it.
    with contextlib.suppress(FileNotFoundError):
        Path(path).replace(f"{path}.damaged")
    raise UserError(
        f"{path} {state}. It is now {Path(path).name}.damaged; run the same command again, which "
        "makes the file again"
    )


def states_of_files(root: str) -> dict[str, State]:
    """Return the state of every file of a run, and of those that are gone and have a checksum.

    Parameters
    ----------
    root : str
        ``results/<name>``.
    """
    checksums = Path(root, "checksums")
    recorded = (file.relative_to(checksums) for file in checksums.rglob("*.sha256"))
    files = {f"{root}/{each.with_suffix('').as_posix()}" for each in recorded}
    files |= {path.as_posix() for path in Path(root).rglob("[!.]*") if path.suffix != ".damaged"}
    return {
        path: state_of(path)
        for path in sorted(files)
        if _checksum_of(path) is not None and not Path(path).is_dir()
    }


def need_intact(root: str) -> None:
    """Raise UserError where a file of a run is not known to be as written, naming the first."""
    faults = [(path, state) for path, state in states_of_files(root).items() if state not in SOUND]
    if faults:
        path, state = faults[0]
        raise UserError(
            f"{path} {state}, {len(faults)} files in all: the target verify says how to make them "
            "again"
        )


def _checksum_of(path: str) -> str | None:
    """Return where the checksum of a run's file lies; None for logs and files of no run."""
    results, *inside = PurePath(path).parts
    if results != "results" or len(inside) < 2 or inside[1] in _NOT_RESULTS:
        return None
    run, *rest = inside
    return f"results/{run}/checksums/{'/'.join(rest)}.sha256"


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
        The lock, held until the file is closed. None where the file system has no such locks; then
        nothing is removed.

    Raises
    ------
    UserError
        If the folder cannot be written, which Snakemake tells in a traceback.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = (folder / "nbv.lock").open("ab")
        # Those of Snakemake, which another user may have made.
        for each in (folder, *folder.iterdir()):
            if not os.access(each, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(each))
    except OSError as error:
        raise UserError(f"{error.filename} cannot be written: {error.strerror}") from error
    try:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for lock in (folder / "locks").glob("*.lock"):
                lock.unlink()
        fcntl.flock(held, fcntl.LOCK_SH)
    except OSError:
        return None
    return held

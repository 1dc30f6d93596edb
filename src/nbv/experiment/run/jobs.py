"""Every job of the workflow logs its progress, and an error ends it with one clear line.

A job reads nothing that changed after it was written, and does not outlive its run.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import gc
import logging
import os
import platform
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any, Literal

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
_NEARLY_FULL_BYTES = 10**8
_FINISHED, _FAILED, _STOPPED = "processor time", "error: ", "stopped"
_NOT_RESULTS = ("logs", "benchmarks", "checksums")
LAST_ERROR = "last_error.txt"
"""In the folder of a run's logs: the line of the job that failed last."""
_LOCK = "run.lock"
# The name of the machine that a run was started on, in the environment of its jobs.
_MACHINE = "NBV_MACHINE_OF_RUN"
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

    The inputs are held to their checksums before, and the outputs get theirs after. A job whose run
    was killed ends as well. Raise SystemExit with status 1, after it has reported an error.

    Parameters
    ----------
    snakemake : object
        What Snakemake gives a script. Rule and wildcards label each line, since several jobs run
        at a time. The traceback of an unexpected error goes to the log file alone. The error's one
        line goes to ``logs/last_error.txt`` too, which `why_stopped` reads.
    """
    path = Path(snakemake.log[0])
    label = " ".join([snakemake.rule, "/".join(snakemake.wildcards)]).strip()
    _log_to(path, label)
    end_with_run(_logs_above(path))
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
            log.error("traceback", exc_info=error, extra={"log_only": True})
            _fail(f"{type(error).__name__}: {error} (traceback in {path})", path)
        reason = " ".join(str(error).split())
        _fail(f"memory ran out ({reason}): use fewer --cores, or smaller settings", path)
    except BaseException:
        log.info(_STOPPED, extra={"log_only": True})
        raise
    else:
        # Snakemake's benchmark only samples it; `nbv.experiment.report.runtime` reads this line.
        log.info(f"{_FINISHED} %.2f s", sum(os.times()[:4]), extra={"log_only": True})


def why_stopped(results: str) -> list[str]:
    """Return the lines that say why a run stopped, of its jobs' logs; none where none says it.

    `results` is the folder of a run that `begin_run` began. Older logs are of earlier runs.
    """
    logs = Path(results, "logs")
    last_error = logs / LAST_ERROR
    lines = last_error.read_text(encoding="utf-8").splitlines() if last_error.exists() else []
    if not lines and shutil.disk_usage(logs).free < _NEARLY_FULL_BYTES:
        # Snakemake's own files are on the disk, too.
        lines = [f"{_FAILED}{results}: {NO_SPACE}"]
    killed = _killed_jobs(logs, (logs / _LOCK).stat().st_mtime)
    # A full disk ends logs in the middle, too.
    if not killed or any(NO_SPACE in line for line in lines):
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


def check_folders(results: str) -> None:
    """Raise UserError for a folder that Snakemake needs and would miss in a traceback."""
    needed = Path(".snakemake")
    for folder in (Path(results), *Path(results).parents, needed):
        if os.path.lexists(folder) and not folder.is_dir():
            raise UserError(f"{folder} is not a folder, which a run needs there; move it away")
    if not os.access(needed if needed.exists() else ".", os.W_OK):
        raise UserError(f"{needed.absolute()} cannot be written: permission denied")


def begin_run(results: str) -> None:
    """Lock the folder of a run's results until this process ends, and forget the last error.

    Jobs on this machine end when the lock does; see `end_with_run`. The lock's file holds where the
    folder lies, which tells a copied run. Raise UserError if the folder cannot be written, or
    another run works on it.
    """
    logs = Path(results, "logs")
    lock, here = logs / _LOCK, str(logs.resolve())
    try:
        logs.mkdir(parents=True, exist_ok=True)
        _lock(lock)
        (logs / LAST_ERROR).unlink(missing_ok=True)
        made_in = lock.read_text(encoding="utf-8")
        lock.write_text(here, encoding="utf-8")
    except BlockingIOError as error:
        raise UserError(f"another run works on {results}: wait until it has ended") from error
    except OSError as error:
        raise UserError(f"{results} cannot be written: {error.strerror}") from error
    if made_in not in ("", here):
        sys.stderr.write(
            f"nbv: warning: {results} is a copy of {Path(made_in).parent}; without that one's "
            ".snakemake, the times of its files decide what runs again: run the same command with "
            "--touch --forceall first\n"
        )


def _lock(path: Path) -> None:
    # Never closed, because the lock would end.
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        # A file system without such locks.
        return
    os.environ[_MACHINE] = platform.node()


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
    # A full disk may not even take this line; the terminal has it already.
    with contextlib.suppress(OSError):
        last_error = _logs_above(log_file) / LAST_ERROR
        last_error.write_text(f"{_FAILED}{message}\n", encoding="utf-8")
    raise SystemExit(1)


def _logs_above(log_file: Path) -> Path:
    """Return the folder of a run's logs."""
    return next((folder for folder in log_file.parents if folder.name == "logs"), log_file.parent)


def write_checksum(path: str) -> None:
    """Write the SHA-256 of a run's file ``results/<name>/…``, in the format of ``sha256sum``.

    Other files have no checksum.
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

    `root` is ``results/<name>``.
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


def end_with_run(logs: Path) -> None:
    """Let this process end with the run that started it on this machine; where none did, not.

    A termination signal becomes an exception, so that a job removes its temporary file. `logs` is
    the folder of the run's logs.
    """
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    # On another machine, the lock may be free though the run lives.
    if os.environ.get(_MACHINE) == platform.node():
        threading.Thread(target=_wait_for_end, args=(logs / _LOCK,), daemon=True).start()


def _wait_for_end(lock: Path) -> None:
    with contextlib.suppress(OSError), lock.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_SH)
        # Nobody waits for this job any more. No other run begins before the lock is free again.
        os._exit(1)

"""Every job of the workflow logs its progress, and an error ends it with one clear line."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nbv.errors import UserError

log = logging.getLogger(__name__)


@contextmanager
def job(snakemake: Any) -> Iterator[None]:
    """Log a job's progress to the terminal and to its log file; end it with one line on an error.

    Parameters
    ----------
    snakemake : object
        What Snakemake gives a script. Rule and wildcards label each line, since several jobs run
        at a time. The traceback of an unexpected error goes to the log file alone. The error's one
        line goes to ``logs/last_error.txt`` too, which the workflow prints when it stops.

    Raises
    ------
    SystemExit
        With status 1, after it has reported an error.
    """
    path = Path(snakemake.log[0])
    label = " ".join([snakemake.rule, "/".join(snakemake.wildcards)]).strip()
    path.parent.mkdir(parents=True, exist_ok=True)
    to_file = logging.FileHandler(path, mode="w", encoding="utf-8")
    to_terminal = logging.StreamHandler(sys.stderr)
    to_terminal.addFilter(lambda record: not getattr(record, "log_only", False))
    root = logging.getLogger()
    for handler in (to_file, to_terminal):
        handler.setFormatter(logging.Formatter(f"[%(asctime)s {label}] %(message)s", "%H:%M:%S"))
        root.addHandler(handler)
    root.setLevel(logging.INFO)
    # A full disk makes every write to the log fail; logging would print a traceback for each.
    logging.raiseExceptions = False
    for noisy in ("matplotlib", "fontTools", "trimesh", "OpenGL"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
    try:
        yield
    except UserError as error:
        _fail(f"{error}", path)
    except OSError as error:
        if error.errno != errno.ENOSPC:
            _fail_unexpectedly(error, path)
        # An error from an open file names no file; only the job's own outputs are open.
        where = error.filename or snakemake.output[0]
        _fail(f"{where}: no space left on the disk; free some and run the same command again", path)
    except Exception as error:
        _fail_unexpectedly(error, path)
    else:
        # Snakemake's benchmark only samples it; `nbv.reporting.runtime` reads this line.
        log.info("processor time %.2f s", sum(os.times()[:4]), extra={"log_only": True})


def _fail(message: str, log_file: Path) -> None:
    log.error("error: %s", message)
    logs = next((folder for folder in log_file.parents if folder.name == "logs"), log_file.parent)
    # A full disk may not even take this line; the terminal has it already.
    with contextlib.suppress(OSError):
        (logs / "last_error.txt").write_text(f"error: {message}\n", encoding="utf-8")
    raise SystemExit(1)


def _fail_unexpectedly(error: Exception, path: Path) -> None:
    log.error("traceback", exc_info=error, extra={"log_only": True})
    _fail(f"{type(error).__name__}: {error} (traceback in {path})", path)

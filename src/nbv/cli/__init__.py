"""The command line: ``nbv recommend``, ``next``, ``calibrate``, ``evaluate`` and others.

Commands import their modules when they run, so that ``nbv --help`` is fast.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Sequence
from itertools import chain
from typing import NoReturn

if sys.version_info < (3, 11):
    sys.exit("nbv: error: the command line needs Python 3.11; with 3.10, import nbv in Python")

from cyclopts import App, CycloptsError

from nbv import __version__
from nbv.cli.answers import print_json
from nbv.cli.arguments import in_flags, joined_numbers
from nbv.cli.bundles import export, inspect, render
from nbv.cli.calibration import calibrate, evaluate
from nbv.cli.estimates import next_view
from nbv.cli.recommendation import recommend
from nbv.errors import NamedError, UserError

USER_ERROR = 2

app = App(
    name="nbv",
    help=(
        "Estimate an object's pose from depth frames and recommend the next view.\n\n"
        "A mistake in the input gives one line and exit code 2."
    ),
    version=__version__,
    help_format="plaintext",
    result_action="return_value",
)
app.command(recommend)
app.command(next_view, name="next")
for command in (calibrate, evaluate, render, inspect, export):
    app.command(command)

# Errors of a full disk or file.
FULL_OUTPUT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

# Threads of a matrix library would wait for each other on small matrices.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 2 after printing one line about a mistake in the input."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        app(_with_next(joined_numbers(given)), exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output has closed it.
        _drop_output()
    except (UserError, CycloptsError, OSError) as error:
        message = _message(error)
        # If the JSON cannot be printed, the line on standard error still is.
        try:
            # An error of standard output itself has no file name.
            can_print = not isinstance(error, OSError) or error.filename is not None
            if "--json" in given and can_print:
                name = error.name if isinstance(error, NamedError) else None
                print_json({"error": {"name": name, "message": message}})
            sys.stdout.flush()
        except OSError:
            _drop_output()
        return _print_error(message)
    return 0


def _with_next(arguments: list[str]) -> list[str]:
    """Return arguments in which ``recommend --table TABLE`` is ``next TABLE``, for one release."""
    former = ("--table=", "--distribution=")
    pairs = [each.split("=", 1) if each.startswith(former) else [each] for each in arguments]
    others = list(chain.from_iterable(pairs))
    if others[:1] != ["recommend"] or "--table" not in others[:-1]:
        return arguments
    hint = "`nbv recommend --table TABLE` is now `nbv next TABLE`, and --distribution --estimate"
    print(f"nbv: {hint}; the old form goes with the next release", file=sys.stderr)  # noqa: T201
    at = others.index("--table")
    table, others = others[at + 1], others[1:at] + others[at + 2 :]
    others = ["--estimate" if each == "--distribution" else each for each in others]
    return joined_numbers(["next", table, *others])


def _drop_output() -> None:
    """Redirect standard output to the null device, because the interpreter flushes it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _message(error: Exception) -> str:
    if not isinstance(error, OSError):
        return in_flags(" ".join(str(error).split()))
    reason = error.strerror or str(error)
    # The name is that of an output file, because readers of input name their files.
    if error.filename:
        return f"{error.filename}: {reason}"
    return f"standard output: {reason}" if error.errno in FULL_OUTPUT else reason


def _print_error(message: str) -> int:
    print(f"nbv: error: {message}", file=sys.stderr)  # noqa: T201
    return USER_ERROR


def run() -> NoReturn:
    """Run the command in ``sys.argv``, and exit."""
    _open_streams()
    # Before numpy is imported, which reads these variables once.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    sys.exit(main())


def _open_streams() -> None:
    """Prepare the standard streams for any character, or exit if standard output is closed."""
    if sys.stderr is None:
        # Otherwise the next opened file would get its number, and the messages of libraries.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stdout is None:
        sys.exit(_print_error("standard output is closed: redirect it to a file or to /dev/null"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")

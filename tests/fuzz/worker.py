"""Reads damaged files within limits: ``python -m tests.fuzz.worker``.

Each line of its input is the JSON list of a reader's name and a path; each line of its output is
the JSON list of an outcome and a detail.
"""

import json
import signal
import sys
import traceback
import warnings
from pathlib import Path

from tests.fuzz.readers import READERS

from nbv.errors import UserError

PROCESSOR_S, CLOCK_S, MAX_BYTES = 60, 900, 6 * 2**30


def outcome_of(name: str, path: Path) -> tuple[str, str]:
    """Return "result" or "refused", which are right, or "failed", with a line about it."""
    reader = READERS[name]
    try:
        problem = reader.problem(reader.read(path))
    except UserError as error:
        message = str(error)
        is_one_line = len(message.splitlines()) == 1 and message.isprintable()
        return ("refused" if is_one_line else "failed"), message
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        place = next((f for f in reversed(frames) if "/nbv/" in f.filename), frames[-1])
        where = f"{place.filename.rpartition('/nbv/')[2]}:{place.lineno}"
        return "failed", f"{type(error).__name__} in {where}: {error}"
    return ("failed", f"accepted: {problem}") if problem else ("result", "")


def main() -> None:
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    except (ImportError, OSError, ValueError):
        pass  # macOS has no such limit
    warnings.simplefilter("ignore")
    for line in sys.stdin:
        name, path = json.loads(line)
        signal.setitimer(signal.ITIMER_PROF, PROCESSOR_S)
        signal.setitimer(signal.ITIMER_REAL, CLOCK_S)
        outcome = outcome_of(name, Path(path))
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        print(json.dumps(outcome), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()

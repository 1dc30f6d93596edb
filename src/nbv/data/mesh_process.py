"""The process that reads mesh files within limits: ``python -m nbv.data.mesh_process``.

Its arguments are the limits: seconds of processor time and of the clock for each file, and bytes of
memory. On its standard input it takes the path of one file a line, as JSON. It answers with one
line of JSON: why the file is refused, or how many vertices and faces follow as raw float64 and
int64.
"""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from nbv.data.mesh_formats import parse_mesh


def main(processor_s: int, clock_s: int, max_bytes: int) -> None:
    """Answer until the standard input ends, as it does with the process that asks."""
    _limit_memory(max_bytes)
    timers = {signal.ITIMER_PROF: processor_s, signal.ITIMER_REAL: clock_s}
    # Without a handler a timer's signal ends the process, even in the middle of compiled code.
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    for line in sys.stdin.buffer:
        for timer, seconds in timers.items():
            signal.setitimer(timer, seconds)
        answer, arrays = _answer(Path(json.loads(line)), max_bytes)
        for timer in timers:
            signal.setitimer(timer, 0)
        _send(sys.stdout.buffer, answer, arrays)


def _limit_memory(max_bytes: int) -> None:
    """Limit this process's memory where the system can: macOS refuses."""
    try:
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (max_bytes, hard))
    except (ImportError, OSError, ValueError):
        return


def _answer(path: Path, max_bytes: int) -> tuple[dict[str, Any], list[Any]]:
    try:
        mesh = parse_mesh(path)
        arrays = [np.asarray(mesh.vertices, "<f8"), np.asarray(mesh.faces, "<i8")]
    except MemoryError:
        return {"refused": f"needs more than {max_bytes / 2**30:g} GiB of memory"}, []
    # No list of what a loader may raise on arbitrary bytes is complete.
    except Exception as error:
        # A reason may quote the file, which may hold anything.
        quoted = "".join(c if c.isprintable() else "?" for c in " ".join(str(error).split()))
        reason = quoted[:300] or type(error).__name__
        return {"refused": f"cannot be read as a mesh ({reason})"}, []
    return {"vertices": len(arrays[0]), "faces": len(arrays[1])}, arrays


def _send(stream: BinaryIO, answer: dict[str, Any], arrays: list[Any]) -> None:
    stream.write(json.dumps(answer).encode() + b"\n")
    for array in arrays:
        stream.write(array.tobytes())
    stream.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

"""Read mesh files in a separate process, with limits of time and memory.

A hostile or damaged file may exhaust time or memory, or crash its loader.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.files import missing

if TYPE_CHECKING:
    import trimesh

PROCESSOR_S = 60
"""Limit of processor time for a file. A million faces as text take about 10 s."""

CLOCK_S = 600
"""Limit of elapsed time for a file, for busy machines, slow disks and files that block."""

MAX_BYTES = 4 * 2**30
"""Limit of memory, libraries included. A million faces as text take less than half of it."""

# No module is imported from the current folder, which is "": Python 3.10 has no option -P.
_START = (
    "import sys; sys.path[:] = filter(None, sys.path); "
    "from nbv.data.mesh_formats import main; main(*map(int, sys.argv[1:]))"
)


class MeshReader:
    """Reads mesh files, one after the other, in one process.

    The process starts with the first file, and again after a file that ended it. It ends with this
    object or with the calling process. The limits are those of a file, seconds, and of memory; the
    last is ignored on systems without such limits, such as macOS.
    """

    def __init__(
        self, processor_s: int = PROCESSOR_S, clock_s: int = CLOCK_S, max_bytes: int = MAX_BYTES
    ) -> None:
        self._limits = (processor_s, clock_s, max_bytes)
        self._process: subprocess.Popen[bytes] | None = None

    def read(self, path: Path) -> trimesh.Trimesh:
        """Load a mesh file as `nbv.data.mesh_formats.parse_mesh` does.

        Raises
        ------
        UserError
            With the path and the reason, such as an exceeded limit.
        """
        import trimesh

        if not path.is_file():
            raise UserError(f"{path} {missing(path)}; a mesh file expected")
        process = self._running()
        try:
            answer, vertices, faces = _ask(process, path)
        except (EOFError, BrokenPipeError) as error:
            reason = self._reason(process.wait())
            self._end()
            self._process = None
            raise UserError(f"{path}: cannot be read as a mesh ({reason})") from error
        if "refused" in answer:
            raise UserError(f"{path}: {answer['refused']}")
        return trimesh.Trimesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), process=False)

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            # The import makes it one of the sources that a result depends on.
            from nbv.data import mesh_formats  # noqa: F401

            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, *map(str, self._limits)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                # The user gets a single line, not the output of libraries.
                stderr=subprocess.DEVNULL,
                # Idle threads would reserve memory.
                env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
            self._end = weakref.finalize(self, _end, self._process)
        return self._process

    def _reason(self, status: int) -> str:
        if status == -signal.SIGPROF:
            return f"it took more than {self._limits[0]} s of processor time"
        if status == -signal.SIGALRM:
            return f"it took more than {self._limits[1]} s"
        with contextlib.suppress(ValueError):
            return f"the reader was ended by {signal.Signals(-status).name}; is memory short?"
        return f"the reader ended with status {status}"


def _ask(
    process: subprocess.Popen[bytes], path: Path
) -> tuple[dict[str, Any], NDArray[Any], NDArray[Any]]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps(str(path.absolute())).encode() + b"\n")
    process.stdin.flush()
    answer: dict[str, Any] = json.loads(process.stdout.readline() or _died())
    arrays = []
    for kind, name in (("<f8", "vertices"), ("<i8", "faces")):
        size = 3 * 8 * answer.get(name, 0)
        content = process.stdout.read(size)
        if len(content) < size:
            _died()
        arrays.append(np.frombuffer(content, dtype=kind))
    return answer, arrays[0], arrays[1]


def _died() -> bytes:
    raise EOFError("the reader is gone")


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.communicate()

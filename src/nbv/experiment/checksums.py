"""A checksum for each file of a run: a change after it was written is noticed when it is read."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Literal

from nbv.errors import UserError
from nbv.experiment.layout import Layout, checksum_of
from nbv.files import sha256_of, write_text

State = Literal["intact", "damaged", "missing", "without checksum"]


def write_checksum(path: str) -> None:
    """Write the SHA-256 of a run's file, in the format of ``sha256sum``.

    Parameters
    ----------
    path : str
        Relative to the project's folder: ``results/<name>/…``. Other files have no checksum.
    """
    record = checksum_of(path)
    if record is not None:
        write_text(record, f"{sha256_of(path)}  {path}\n")


def state_of(path: str) -> State:
    """Return whether a file is what it was when its checksum was written."""
    record = checksum_of(path)
    if not Path(path).is_file():
        return "missing"
    if record is None or not Path(record).is_file():
        return "without checksum"
    return "intact" if sha256_of(path) == _written(record) else "damaged"


def check(path: str) -> None:
    """Set a damaged file aside.

    Raises
    ------
    UserError
        Naming the file. It has the suffix ``.damaged`` now, and the same command makes it again.
    """
    if state_of(path) != "damaged":
        return
    # Another job may have found it at the same time, and moved it.
    with contextlib.suppress(FileNotFoundError):
        Path(path).replace(f"{path}.damaged")
    raise UserError(
        f"{path} changed after it was written: its checksum differs. It is now "
        f"{Path(path).name}.damaged; run the same command again, which makes the file again"
    )


def states_of_files(root: str) -> dict[str, State]:
    """Return the state of every file of a run that has a checksum.

    Parameters
    ----------
    root : str
        ``results/<name>``.
    """
    folder = Path(Layout(root).checksums)
    inside = (path.relative_to(folder).with_suffix("") for path in folder.rglob("*.sha256"))
    return {path: state_of(path) for path in sorted(f"{root}/{each.as_posix()}" for each in inside)}


def need_intact(root: str) -> None:
    """Raise UserError where a file of a run is damaged, naming the first."""
    damaged = [path for path, state in states_of_files(root).items() if state == "damaged"]
    if damaged:
        raise UserError(
            f"{damaged[0]} changed after it was written, {len(damaged)} files in all: "
            "the target verify says how to make them again"
        )


def _written(record: str) -> str:
    return Path(record).read_text(encoding="ascii", errors="replace").partition(" ")[0]

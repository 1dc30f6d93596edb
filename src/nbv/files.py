"""Writing files whole or not at all, with the same bytes for the same content."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.errors import UserError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block succeeds.

    The suffix of `path` is kept, for writers that choose a format by it. On any error the
    temporary file is removed and `path` is left as it was.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.stem}.partial{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: str | Path, value: Any) -> None:
    """Write JSON, indented, with sorted keys."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False) + "\n")


def write_csv(path: str | Path, frame: pd.DataFrame, decimals: int = 4) -> None:
    """Write a table without its index; floats are rounded to `decimals`, absent values empty."""
    with replacing(path) as temporary:
        frame.round(decimals).to_csv(temporary, index=False, lineterminator="\n")


def read_csv(path: str | Path) -> pd.DataFrame:
    """Read a table written by `write_csv`.

    Object ids stay the text they are (``007``, ``NA``, ``null``); in other columns empty cells are
    absent values and nothing else is.
    """
    columns = pd.read_csv(path, nrows=0).columns
    empty = {name: [""] for name in columns if name != "object_id"}
    return pd.read_csv(path, dtype={"object_id": str}, keep_default_na=False, na_values=empty)


def write_arrays(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as a compressed `.npz` (deterministic: numpy dates members 1980)."""
    with replacing(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def open_array(path: str | Path) -> NDArray[Any]:
    """Open an array stored as `.npy`, read-only and without reading it into memory."""
    stored: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return stored


def read_arrays(path: str | Path) -> dict[str, NDArray[Any]]:
    """Read a whole `.npz` written by `write_arrays`."""
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def existing(path: Path) -> Path:
    """Return the path of a file that has to be there.

    Raises
    ------
    UserError
        If it is not.
    """
    if not path.is_file():
        raise UserError(f"{path} does not exist; finish the run first, or is it another folder?")
    return path

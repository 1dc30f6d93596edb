"""Files are written whole or not at all, and the same content gives the same bytes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError

if TYPE_CHECKING:
    import pandas as pd


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; it replaces `path` when the block succeeds.

    The temporary path keeps the suffix, for writers that choose a format by it. An error removes
    the temporary file and leaves `path` as it was.
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
    """Write a frame without its index; round floats to `decimals`, leave absent values empty."""
    with replacing(path) as temporary:
        frame.round(decimals).to_csv(temporary, index=False, lineterminator="\n")


def read_csv(path: str | Path) -> pd.DataFrame:
    """Read what `write_csv` wrote.

    Object ids stay text as written (``007``, ``NA``, ``null``). In other columns an empty cell,
    and nothing else, is an absent value.
    """
    import pandas as pd  # here, so that loading a lookup table costs no import of pandas

    columns = pd.read_csv(path, nrows=0).columns
    empty = {name: [""] for name in columns if name != "object_id"}
    return pd.read_csv(path, dtype={"object_id": str}, keep_default_na=False, na_values=empty)


def write_arrays(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as a compressed `.npz` (same bytes: numpy dates its members 1980)."""
    with replacing(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def open_array(path: str | Path) -> NDArray[Any]:
    """Map an array stored as `.npy` into memory, read-only."""
    stored: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return stored


def read_arrays(path: str | Path) -> dict[str, NDArray[Any]]:
    """Read a whole `.npz` written by `write_arrays`."""
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def existing(path: str | Path) -> Path:
    """Return `path`.

    Raises
    ------
    UserError
        If no file is there.
    """
    if not Path(path).is_file():
        raise UserError(f"{path} does not exist; finish the run first, or is it another folder?")
    return Path(path)

"""Files are written whole or not at all, and the same content gives the same bytes."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError, reason_of

if TYPE_CHECKING:
    import pandas as pd


RUN_AGAIN = "delete the file and run the same command again"
"""What mends a file of a run."""

CALIBRATE_AGAIN = f"make it again with nbv calibrate, or where it is of a run, {RUN_AGAIN}"
"""What mends a table that either made."""


_COMPRESSED = (".gz", ".bz2", ".xz", ".zip")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; it replaces `path` when the block succeeds.

    The temporary path keeps the suffix, for writers that choose a format by it. An error removes
    the temporary file and leaves `path` as it was. A name is used once: whoever still writes the
    same file, such as a job whose run was killed, loses its temporary file here and fails. An
    OSError of the temporary file, or of no file, such as of a full disk, names `path`.
    """
    target = as_path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    for left_over in target.parent.glob(f".{escape(target.stem)}.*.partial{escape(target.suffix)}"):
        left_over.unlink(missing_ok=True)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.partial{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        if error.errno is None:
            # numpy's, of a disk that is full.
            raise OSError(errno.EIO, f"cannot be written ({error})", str(target)) from error
        if error.filename in (None, temporary, str(temporary)):
            error.filename = str(target)
        raise
    finally:
        # Where it cannot be removed, what went wrong before says why.
        with suppress(OSError):
            temporary.unlink()


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


@contextmanager
def readable(path: str | Path, remedy: str = RUN_AGAIN) -> Iterator[None]:
    """Turn whatever a reader raises on a damaged file into one line that names the file.

    Parameters
    ----------
    path : path
    remedy : str
        What to do where it is damaged.

    Raises
    ------
    UserError
        Where the file is missing, or what the block reads of it cannot be read.
    """
    try:
        yield
    except UserError:
        raise
    except FileNotFoundError as error:
        raise UserError(f"{path} does not exist; finish the run first") from error
    # No list of what a reader may raise on arbitrary bytes is complete.
    except Exception as error:
        raise damaged(path, f"cannot be read ({reason_of(error)})", remedy) from error


def missing(path: str | Path) -> str:
    """Return what is wrong with a path where there is no file."""
    return "is a folder" if Path(path).is_dir() else "does not exist"


def damaged(path: str | Path, what: str, remedy: str = RUN_AGAIN) -> UserError:
    """Return the error of a file that holds what none of the project's writers writes."""
    return UserError(f"{path}: {what}; {remedy}")


def as_path(value: str | Path) -> Path:
    """Return a path; UserError where it is none."""
    try:
        return Path(value)
    except TypeError:
        raise UserError(f"{value!r} is no name of a file") from None


def calibrated_file(path: str | Path) -> Path:
    """Return the path of a file that nbv calibrate, or a run, wrote; UserError where none is."""
    if not (found := as_path(path)).is_file():
        raise UserError(f"{path} {missing(path)}; name the file that nbv calibrate wrote")
    return found


def read_csv(path: str | Path) -> pd.DataFrame:
    """Read what `write_csv` wrote.

    Object ids stay text as written (``007``, ``NA``, ``null``). In other columns an empty cell,
    and nothing else, is an absent value.

    Raises
    ------
    UserError
        As of `readable`.
    """
    import pandas as pd  # here, so that loading a lookup table costs no import of pandas

    with readable(path):
        columns = pd.read_csv(path, nrows=0).columns
        empty = {name: [""] for name in columns if name != "object_id"}
        return pd.read_csv(path, dtype={"object_id": str}, keep_default_na=False, na_values=empty)


def check_columns(path: str | Path, frame: pd.DataFrame, columns: Iterable[str]) -> None:
    """Raise UserError where a column is missing, or there is no row."""
    for name in columns:
        if name not in frame.columns:
            raise damaged(path, f"no column {name!r}")
    if frame.empty:
        raise damaged(path, "holds no rows")


def write_arrays(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as a compressed `.npz` (same bytes: numpy dates its members 1980)."""
    # An open file, because numpy adds a suffix to names in capitals.
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def open_array(path: str | Path) -> NDArray[Any]:
    """Map an array stored as `.npy` into memory, read-only; errors as of `readable`."""
    with readable(path):
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(stored, np.ndarray):
            raise ValueError("not one array")
        return stored


def read_text(path: Path) -> str:
    """Return a text that a user wrote, which may begin with a byte order mark.

    Raises
    ------
    UserError
        Where it is not UTF-8; it names the line. What else is wrong with the file is an OSError.
    """
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        what = "this is not UTF-8; save the file as UTF-8"
        raise UserError(f"{path}, line {line}: {what}") from error


def read_rows(path: Path, needed: Sequence[str], frames_hint: str = "") -> pd.DataFrame:
    """Read a user's CSV file as text: an object may be called NA.

    Parameters
    ----------
    path : path
    needed : sequence of str
        Columns that it must have.
    frames_hint : str
        What the message adds where one is missing, and a column ``file`` names frames.

    Raises
    ------
    UserError
        Where it cannot be read, a column of `needed` is missing, or it has no rows.
    """
    import pandas as pd  # here, so that loading a lookup table costs no import of pandas

    if not path.is_file():
        raise UserError(f"{path} {missing(path)}; name a file with {', '.join(needed)}")
    try:
        source: Path | io.StringIO = path
        if path.suffix not in _COMPRESSED:
            if not (text := read_text(path)).strip():
                raise UserError(f"{path} is empty; it needs {', '.join(needed)}")
            source = io.StringIO(text)
        table = pd.read_csv(source, dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error
    for name in needed:
        if name not in table:
            hint = "; commas stand between columns" if table.shape[1] == 1 else ""
            hint = frames_hint if "file" in table else hint
            raise UserError(f"{path}: no column {name!r}; it needs {', '.join(needed)}{hint}")
    if table.empty:
        raise UserError(f"{path} has no rows")
    return table


def read_numbers(path: Path) -> NDArray[Any]:
    """Return the numbers of a file that a user wrote: ``.npy``, ``.json``, or text.

    Raises
    ------
    UserError
        Where the file does not exist, or cannot be read.
    """
    try:
        if path.suffix.lower() == ".npy":
            return np.asarray(np.load(path, allow_pickle=False))
        text = read_text(path)
        if path.suffix.lower() == ".json":
            return np.asarray(json.loads(text), dtype=np.float64)
        return np.array([float(number) for number in text.replace(",", " ").split()])
    except UserError:
        raise
    except FileNotFoundError as error:
        raise UserError(f"{path} does not exist") from error
    # No list of what a reader may raise on arbitrary bytes is complete.
    except Exception as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error


def read_arrays(
    path: str | Path, names: Iterable[str] = (), remedy: str = RUN_AGAIN
) -> dict[str, NDArray[Any]]:
    """Read a whole `.npz` written by `write_arrays`.

    Parameters
    ----------
    path : path
    names : iterable of str
        Arrays that have to be there.
    remedy : str
        See `readable`.

    Raises
    ------
    UserError
        Where one of `names` is missing, and as of `readable`.
    """
    with readable(path, remedy), np.load(path, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    for name in names:
        if name not in arrays:
            raise damaged(path, f"holds no array {name!r}", remedy)
    return arrays


def check_distributions(
    path: str | Path,
    densities: NDArray[np.floating[Any]],
    shape: tuple[int, ...],
    remedy: str = RUN_AGAIN,
) -> None:
    """Raise UserError where the rows of an array of that shape are no distributions.

    They may miss a sum of 1 by what single precision rounds. For the remedy see `readable`.
    """
    if densities.shape != shape:
        what = f"an array has the shape {densities.shape} in place of {shape}"
        raise damaged(path, what, remedy)
    sums = densities.sum(axis=-1, dtype=np.float64)
    # Written so that NaN is refused as well.
    if not ((densities >= 0).all() and (np.abs(sums - 1.0) < 1e-3).all()):
        what = "a row is no distribution: it is negative or does not sum to 1"
        raise damaged(path, what, remedy)


def read_json(path: str | Path) -> Any:
    """Read what `write_json` wrote; errors as of `readable`."""
    with readable(path):
        return json.loads(Path(path).read_text(encoding="utf-8"))


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


def sha256_of(path: str) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

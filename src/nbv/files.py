"""Files: atomic writers with reproducible bytes, and readers whose errors name the file."""

from __future__ import annotations

import bz2
import csv
import difflib
import errno
import gzip
import hashlib
import io
import json
import lzma
import re
import secrets
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from nbv.errors import UserError, reason_of

if TYPE_CHECKING:
    import pandas as pd


Arrays = dict[str, NDArray[Any]]

RUN_AGAIN = "delete the file and run the same command again"
"""Remedy for a damaged file of a run."""

CALIBRATE_AGAIN = f"make it again with nbv calibrate, or for a file of a run, {RUN_AGAIN}"
"""Remedy for a damaged table of nbv calibrate or of a run."""


_NUMBERS = re.compile(r"[-+.\d][-+.\deE ]*")

_COMPRESSED: Mapping[str, Any] = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open}


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; it replaces `path` if the block succeeds.

    The temporary path keeps the suffix, which some writers use to choose a format. An error removes
    the temporary file and leaves `path` unchanged. Temporary files of other writers of `path`, such
    as a job whose run was killed, are removed, so that they fail. An OSError without a file, such
    as for a full disk, or with the temporary file names `path`.
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
            # numpy raises this for a full disk.
            raise OSError(errno.EIO, f"cannot be written ({error})", str(target)) from error
        if error.filename in (None, temporary, str(temporary)):
            error.filename = str(target)
        raise
    finally:
        # If it cannot be removed, the previous error tells why.
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
    """Write a frame without its index; floats are rounded, missing values are empty."""
    with replacing(path) as temporary:
        frame.round(decimals).to_csv(temporary, index=False, lineterminator="\n")


@contextmanager
def readable(path: str | Path, remedy: str = RUN_AGAIN) -> Iterator[None]:
    """Convert any error of a reader into a UserError that names the file, and a remedy."""
    try:
        yield
    except UserError:
        raise
    except FileNotFoundError as error:
        raise UserError(f"{path} does not exist; finish the run first") from error
    # A reader may raise any exception on arbitrary bytes.
    except Exception as error:
        raise damaged(path, f"cannot be read ({reason_of(error)})", remedy) from error


def missing(path: str | Path) -> str:
    """Return why a path is not a file."""
    if Path(path).is_dir():
        return "is a folder"
    return "is not a regular file" if Path(path).exists() else "does not exist"


def damaged(path: str | Path, what: str, remedy: str = RUN_AGAIN) -> UserError:
    """Return the error for a file with content that none of the project's writers produces."""
    return UserError(f"{path}: {what}; {remedy}")


def as_path(value: str | Path) -> Path:
    """Convert a value to a path; raise UserError if it is not a file name."""
    try:
        return Path(value)
    except TypeError:
        raise UserError(f"{value!r} is not a file name") from None


def calibrated_file(path: str | Path) -> Path:
    """Return the path of a file of nbv calibrate or a run; raise UserError if it is missing."""
    file = as_path(path)
    if not file.is_file():
        raise UserError(f"{path} {missing(path)}; name the file that nbv calibrate wrote")
    return file


@contextmanager
def stored_table(path: str | Path, names: Iterable[str], kind: str) -> Iterator[Arrays]:
    """Yield the arrays of a table of nbv calibrate or of a run, for checks with its remedy.

    Every table of this kind has arrays of these names; `kind` is what it holds, for messages. Raise
    UserError if the file cannot be read, is of another kind, or the block raises any error.
    """
    arrays = read_arrays(calibrated_file(path), (), CALIBRATE_AGAIN)
    if not set(names) <= set(arrays):
        raise damaged(path, f"holds no {kind}", CALIBRATE_AGAIN)
    with readable(path, CALIBRATE_AGAIN):
        yield arrays


def read_csv(path: str | Path) -> pd.DataFrame:
    """Read a file of `write_csv`, with the errors of `readable`.

    Object ids stay text (``007``, ``NA``, ``null``). In other columns only empty cells are missing
    values.
    """
    import pandas as pd  # here, so that loading a lookup table costs no import of pandas

    with readable(path):
        columns = pd.read_csv(path, nrows=0).columns
        empty = {name: [""] for name in columns if name != "object_id"}
        return pd.read_csv(path, dtype={"object_id": str}, keep_default_na=False, na_values=empty)


def check_columns(path: str | Path, frame: pd.DataFrame, columns: Iterable[str]) -> None:
    """Raise UserError if a column is missing or there are no rows."""
    for name in columns:
        if name not in frame.columns:
            raise damaged(path, f"no column {name!r}")
    if frame.empty:
        raise damaged(path, "holds no rows")


def write_arrays(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as a compressed `.npz`; its bytes are reproducible."""
    # An open file, because numpy adds a suffix to upper-case names.
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def write_rows(
    path: str | Path, rows: Iterable[NDArray[Any]], shape: tuple[int, ...], dtype: DTypeLike
) -> None:
    """Write an array (n, ...) to an `.npy` file row by row, so that memory holds one of them."""
    header = {
        "descr": np.lib.format.dtype_to_descr(np.dtype(dtype)),
        "fortran_order": False,
        "shape": shape,
    }
    # Not memory-mapped: a full disk then raises an error instead of a fatal signal.
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        for row in rows:
            file.write(np.ascontiguousarray(row, dtype=dtype).tobytes())


def open_array(path: str | Path) -> NDArray[Any]:
    """Map an `.npy` file into memory, read-only, with the errors of `readable`."""
    with readable(path):
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(stored, np.ndarray):
            raise ValueError("not one array")
        return stored


def read_text(path: Path) -> str:
    """Read a user's text, which may begin with a byte order mark.

    Raises
    ------
    UserError
        If the file holds arrays of numpy, or a line is not UTF-8.
    OSError
        If the file cannot be read.
    """
    content = path.read_bytes()
    if content.startswith((b"\x93NUMPY", b"PK")):
        raise UserError(f"{path} holds arrays of numpy (.npy, .npz); give a text file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        what = "this is not UTF-8; save the file as UTF-8"
        raise UserError(f"{path}, line {line}: {what}") from error


def read_rows(path: Path, needed: Sequence[str]) -> pd.DataFrame:
    """Read a user's CSV file as text, so that an object may be called NA.

    Spaces around a cell do not count, nor do capitals in the head and comments (#) before it. Raise
    UserError if the file cannot be read, a needed column is missing, one occurs twice, there are no
    rows, or a row has more or fewer values than the head.
    """
    import pandas as pd  # here, so that loading a lookup table costs no import of pandas

    wanted = ", ".join(needed) or "a row of column names"
    if not path.is_file():
        raise UserError(f"{path} {missing(path)}; name a file with {wanted}")
    try:
        opened = _COMPRESSED.get(path.suffix)
        text = opened(path, "rt", encoding="utf-8-sig").read() if opened else read_text(path)
        # Not by pandas, which pads a short row and takes the first of too many values for an index.
        reader = csv.reader(io.StringIO(text, newline=""), strict=True, skipinitialspace=True)
        rows = [[cell.strip() for cell in row] for row in reader if row]
    except (OSError, ValueError, EOFError, csv.Error, lzma.LZMAError) as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error
    if not rows:
        raise UserError(f"{path} is empty; it needs {wanted}")
    # A comment above numbers is the head, as numpy.savetxt writes it.
    while rows[1:] and rows[0][0].startswith("#") and not any(map(_NUMBERS.fullmatch, rows[1])):
        rows.pop(0)
    head = _plain_names(rows[0])
    for i, row in enumerate(rows, start=1):
        if len(row) != len(head):
            raise UserError(
                f"{path}, row {i}: {len(row)} values and the head has {len(head)}: separate them "
                "by commas, write 0.5 and not 0,5, and quote a value that holds a comma"
            )
    names = [name for name in head if name and not _NUMBERS.fullmatch(name)]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(f"{path}: two columns {twice[0]!r}; leave one of them out")
    table = pd.DataFrame(rows[1:], columns=head, dtype=str)
    need_columns(path, table, needed)
    if table.empty:
        raise UserError(f"{path} has no rows")
    return table


def _plain_names(head: Sequence[str]) -> list[str]:
    """Return names of columns in the project's case, unless two of them differ in case alone."""
    names = [head[0].lstrip("# "), *head[1:]]
    plain = [re.sub(r"^r(?=$|_)", "R", name.lower()) for name in names]
    return [p if plain.count(p) == 1 else name for p, name in zip(plain, names, strict=True)]


def need_columns(path: Path, table: pd.DataFrame, needed: Sequence[str]) -> None:
    """Raise UserError if a user's table lacks a needed column; see `read_rows`."""
    given = list(map(str, table))
    for name in needed:
        if name not in given:
            near = difflib.get_close_matches(name, given, 1)
            hint = f"; is it {near[0]!r}? then rename that" if near else ""
            if len(list(filter(_NUMBERS.fullmatch, given))) > len(given) / 2:
                hint = "; row 1 holds numbers: put a row of these names above it"
            elif len(given) == 1:
                hint = "; separate columns by commas"
            raise UserError(f"{path}: no column {name!r}; it needs {', '.join(needed)}{hint}")


def read_numbers(path: Path) -> NDArray[Any]:
    """Read the numbers of a user's ``.npy`` file.

    Raise UserError if the file does not exist or cannot be read.
    """
    if not path.is_file():
        raise UserError(f"{path} {missing(path)}")
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    # A reader may raise any exception on arbitrary bytes.
    except Exception as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error


def read_arrays(
    path: str | Path, names: Iterable[str] = (), remedy: str = RUN_AGAIN
) -> dict[str, NDArray[Any]]:
    """Read an `.npz` of `write_arrays`, with the errors of `readable`.

    Raise UserError if one of the arrays `names` is missing.
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
    """Raise UserError unless an array has a shape and its rows are distributions.

    Sums may differ from 1 by the rounding of single precision.
    """
    if densities.shape != shape:
        what = f"an array has the shape {densities.shape} instead of {shape}"
        raise damaged(path, what, remedy)
    sums = densities.sum(axis=-1, dtype=np.float64)
    # NaN is refused too.
    if not ((densities >= 0).all() and (np.abs(sums - 1.0) < 1e-3).all()):
        what = "a row is not a distribution: it is negative or does not sum to 1"
        raise damaged(path, what, remedy)


def read_json(path: str | Path) -> Any:
    """Read a file of `write_json`, with the errors of `readable`."""
    with readable(path):
        return json.loads(Path(path).read_text(encoding="utf-8"))


def read_given_json(path: Path, remedy: str) -> Any:
    """Read a user's JSON file; raise UserError with the remedy where it is none."""
    if not path.is_file():
        raise UserError(f"{path} {missing(path)}")

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made = dict(pairs)
        if len(made) < len(pairs):
            again = Counter(name for name, _ in pairs).most_common(1)[0][0]
            raise UserError(f"{path}: the key {again!r} is there twice; keep one")
        return made

    with readable(path, remedy):
        return json.loads(read_text(path), object_pairs_hook=once)


def existing(path: str | Path) -> Path:
    """Return `path`; raise UserError if it is not a file."""
    if not Path(path).is_file():
        raise UserError(f"{path} {missing(path)}; finish the run first, or is it another folder?")
    return Path(path)


def sha256_of(path: str) -> str:
    """Return the hexadecimal SHA-256 of a file."""
    digest = hashlib.sha256()
    with Path(path).open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()

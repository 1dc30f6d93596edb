"""Damage: the same seed damages the same bytes in the same way."""

import io
import zipfile
from collections.abc import Callable

import numpy as np

Generator = np.random.Generator
Mutation = Callable[[bytes, Generator], bytes]
SPECIAL = (
    *("nan", "inf", "-inf", "1e300", "-1e300", "1e38", "-1", "0", "0.5", "1e-320", "99999999999"),
    *("4294967296", "-2147483649", "", "x", "null", "1_0", "\x00", "0x10", "é", "10" * 400),
)


def mutate(data: bytes, others: list[bytes], rng: Generator) -> bytes:
    """Return damaged bytes.

    Parameters
    ----------
    data : bytes
        A valid file.
    others : list of bytes
        Valid files of other formats.
    rng : numpy.random.Generator
    """
    kinds = [*BYTES]
    if data[:2] == b"PK":
        kinds += ARCHIVE * 3
    elif _is_text(data):
        kinds += TEXT * 2
    if rng.random() < 0.05:
        return others[rng.integers(len(others))]
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if data:
            data = kinds[rng.integers(len(kinds))](data, rng)
    return data


def _is_text(data: bytes) -> bool:
    try:
        return "\x00" not in data.decode()
    except UnicodeDecodeError:
        return False


def _span(data: bytes, rng: Generator, longest: int = 200) -> slice:
    start = int(rng.integers(len(data)))
    return slice(start, start + int(rng.integers(1, longest)))


def flip_bits(data: bytes, rng: Generator) -> bytes:
    changed = bytearray(data)
    for at in rng.integers(len(data), size=int(rng.choice([1, 1, 1, 8]))):
        changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def truncate(data: bytes, rng: Generator) -> bytes:
    return data[: int(rng.integers(len(data)))]


def cut_end(data: bytes, rng: Generator) -> bytes:
    return data[: -int(rng.integers(1, 30))]


def delete(data: bytes, rng: Generator) -> bytes:
    span = _span(data, rng)
    return data[: span.start] + data[span.stop :]


def duplicate(data: bytes, rng: Generator) -> bytes:
    span = _span(data, rng)
    return data[: span.stop] + data[span] + data[span.stop :]


def swap(data: bytes, rng: Generator) -> bytes:
    changed = bytearray(data)
    one, other = (int(at) for at in rng.integers(len(data), size=2))
    changed[one], changed[other] = changed[other], changed[one]
    return bytes(changed)


def zeros(data: bytes, rng: Generator) -> bytes:
    span = _span(data, rng)
    return data[: span.start] + bytes(len(data[span])) + data[span.stop :]


def append(data: bytes, rng: Generator) -> bytes:
    return data + rng.bytes(int(rng.integers(1, 50)))


def empty(data: bytes, rng: Generator) -> bytes:
    return b""


def _on_lines(change: Callable[[list[bytes], int, Generator], None]) -> Mutation:
    def mutation(data: bytes, rng: Generator) -> bytes:
        lines = data.split(b"\n")
        change(lines, int(rng.integers(len(lines))), rng)
        return b"\n".join(lines)

    return mutation


def _delete_line(lines: list[bytes], at: int, rng: Generator) -> None:
    del lines[at]


def _duplicate_line(lines: list[bytes], at: int, rng: Generator) -> None:
    lines.insert(at, lines[at])


def _swap_lines(lines: list[bytes], at: int, rng: Generator) -> None:
    other = int(rng.integers(len(lines)))
    lines[at], lines[other] = lines[other], lines[at]


def _separator(line: bytes) -> bytes:
    return b"," if b"," in line else b" "


def _change_field(lines: list[bytes], at: int, rng: Generator) -> None:
    fields = lines[at].split(_separator(lines[at]))
    special = SPECIAL[rng.integers(len(SPECIAL))].encode()
    fields[rng.integers(len(fields))] = special
    lines[at] = _separator(lines[at]).join(fields)


def _delete_field(lines: list[bytes], at: int, rng: Generator) -> None:
    fields = lines[at].split(_separator(lines[at]))
    del fields[rng.integers(len(fields))]
    lines[at] = _separator(lines[at]).join(fields)


def _delete_column(lines: list[bytes], at: int, rng: Generator) -> None:
    column = int(rng.integers(8))
    for row, line in enumerate(lines):
        fields = line.split(_separator(line))
        lines[row] = _separator(line).join(fields[:column] + fields[column + 1 :])


def _end_line_otherwise(lines: list[bytes], at: int, rng: Generator) -> None:
    lines[at] += (b"\r", b"\x00", b"\x0c", b"\xff", b'"', b"\\", b"#")[rng.integers(7)]


def _on_members(change: Callable[[dict[str, bytes], str, Generator], None]) -> Mutation:
    def mutation(data: bytes, rng: Generator) -> bytes:
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                members = {name: archive.read(name) for name in archive.namelist()}
        except Exception:
            return flip_bits(data, rng)  # damaged already
        if not members:
            return data
        change(members, sorted(members)[rng.integers(len(members))], rng)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        return packed.getvalue()

    return mutation


def _delete_member(members: dict[str, bytes], name: str, rng: Generator) -> None:
    del members[name]


def _rename_member(members: dict[str, bytes], name: str, rng: Generator) -> None:
    new = ("../../escaped.npy", "/tmp/escaped.npy", "other.npy", "x")[rng.integers(4)]
    members[new] = members.pop(name)


def _damage_member(members: dict[str, bytes], name: str, rng: Generator) -> None:
    if members[name]:
        members[name] = BYTES[rng.integers(len(BYTES))](members[name], rng)


def _array_of(content: bytes, rng: Generator) -> np.ndarray:
    array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    flat = array.reshape(-1).copy()
    match rng.integers(5):
        case 0 if array.dtype.kind == "f" and flat.size:
            flat[rng.integers(flat.size)] = rng.choice([np.nan, np.inf, 1e30, -1.0, 1e-300])
        case 0 | 1 if array.dtype.kind in "iu" and flat.size:
            flat[rng.integers(flat.size)] = rng.choice([-1, 2**31 - 1, 0])
        case 2 if array.ndim:
            return array[: int(rng.integers(len(array) + 1))]
        case 3:
            return array.T.astype(rng.choice(["f8", "i2", "U3"]))
        case 4 if array.ndim:
            return array[::-1]
    return flat.reshape(array.shape)


def _change_array(members: dict[str, bytes], name: str, rng: Generator) -> None:
    try:
        changed = _array_of(members[name], rng)
    except Exception:
        return  # damaged already, or not of this kind of number
    packed = io.BytesIO()
    np.lib.format.write_array(packed, np.asarray(changed), allow_pickle=False)
    members[name] = packed.getvalue()


def _bomb(members: dict[str, bytes], name: str, rng: Generator) -> None:
    """A header that announces a terabyte, or objects that only pickle could make."""
    shape, kind = ((1 << 37,), "<f8") if rng.random() < 0.5 else ((3,), "|O")
    packed = io.BytesIO()
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(packed, header)
    members[name] = packed.getvalue() + bytes(1000)


BYTES = [flip_bits, truncate, cut_end, delete, duplicate, swap, zeros, append, empty]
TEXT: list[Mutation] = [
    _on_lines(change)
    for change in (
        *(_delete_line, _duplicate_line, _swap_lines, _change_field, _change_field),
        *(_delete_field, _delete_column, _end_line_otherwise),
    )
]
ARCHIVE: list[Mutation] = [
    _on_members(change)
    for change in (
        *(_delete_member, _rename_member, _damage_member, _change_array, _change_array, _bomb),
    )
]

"""Strict readers of mesh files: trimesh, after checks for damage that it silently ignores.

A file is read into memory and cannot refer to another file, such as a texture or an external
buffer. As a program, ``python -m nbv.data.mesh_formats``, it is the process of
`nbv.data.mesh_reader`, for a hostile file may exhaust time and memory.
"""

from __future__ import annotations

import io
import json
import re
import signal
import struct
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np
import trimesh


class _OnlyThisFile(trimesh.resolvers.Resolver):
    """Refuses references to other files."""

    def __init__(self) -> None:
        pass

    def get(self, name: str) -> NoReturn:
        raise ValueError(f"it refers to {str(name)[:80]!r}; only data within the file are read")

    def write(self, name: str, data: object) -> NoReturn:
        raise ValueError("nothing is written")

    def namespaced(self, namespace: str) -> _OnlyThisFile:
        return self

    def keys(self) -> tuple[str, ...]:
        return ()


def parse_mesh(path: Path) -> trimesh.Trimesh:
    """Load a mesh file without merging or reordering vertices, and without materials.

    The parts of a scene are transformed and joined.

    Parameters
    ----------
    path : pathlib.Path
        A regular file; the extension determines the format.

    Returns
    -------
    trimesh.Trimesh
        Triangles with valid indices; vertices may not be finite.

    Raises
    ------
    Exception
        Of any type, with the reason, if the file is damaged or has another format.
    """
    extension = path.suffix.lower()
    # skip_materials: a texture of a few kilobytes may decompress to gigabytes.
    options: dict[str, Any] = {"process": False, "skip_materials": True}
    with warnings.catch_warnings():
        # Before numpy 2.3, text that is not a number only raised a warning and ended the array.
        warnings.filterwarnings("error", message="string or file could not be read")
        scene = trimesh.load_scene(
            _checked_file(path.read_bytes(), extension),
            file_type=extension.removeprefix("."),
            resolver=_OnlyThisFile(),
            **options,
        )
    for part in scene.geometry.values():
        if isinstance(part, trimesh.Trimesh):
            # After joining, an invalid index would refer to the next part.
            _check_indices(part.faces, len(part.vertices))
            _check_list_lengths(part.metadata.get("_ply_raw", {}))
    mesh = scene.to_mesh()
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError("it holds no mesh; at least 1 triangle expected")
    return mesh


def _checked_file(data: bytes, extension: str) -> io.StringIO | io.BytesIO:
    """Return a file's content for trimesh; raise ValueError for damage that trimesh accepts."""
    if not data:
        raise ValueError("the file is empty; at least 1 triangle expected")
    if extension == ".obj":
        return io.StringIO(_checked_obj(_decoded(data)))
    if extension == ".off":
        _check_off(_decoded(data))
    elif extension == ".ply" and b"ascii" in b"".join(data.split(b"\n", 2)[1:2]):
        _check_ascii_ply(data.decode("utf-8"))
    elif extension == ".stl" and len(data) != _binary_stl_size(data):
        _check_ascii_stl(_decoded(data))
    elif extension == ".glb":
        _check_glb(data)
    return io.BytesIO(data)


def _decoded(data: bytes) -> str:
    """Decode text of any encoding without loss, so that damaged numbers stay invalid."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _check_indices(indices: Any, n_vertices: int) -> None:
    low, high = (int(indices.min()), int(indices.max())) if len(indices) else (0, -1)
    if low < 0 or high >= n_vertices:
        wrong = low if low < 0 else high
        raise ValueError(f"a face refers to vertex {wrong}, of {n_vertices} vertices")


_OBJ_INDEX = r"[ \t]+-?\d+"
# All corners of a face have the same form: v, v/t, v//n or v/t/n.
_OBJ_FACE = re.compile(
    "f(?:"
    + "|".join(
        f"(?:{_OBJ_INDEX}{rest}){{3,}}" for rest in ("", r"/-?\d+/?", r"//-?\d+", r"/-?\d+/-?\d+")
    )
    + r")[ \t]*"
)
_OBJ_FIRST_INDEX = re.compile(r"[ \t](-?\d+)")


def _checked_obj(text: str) -> str:
    """Return the text of an OBJ file with lines of vertices and faces that trimesh recognises."""
    text = text.replace("\r\n", "\n").replace("\\\n", "")
    # Trimesh ignores indented lines of vertices and faces.
    text = re.sub(r"^[ \t]*([vf])[ \t]+", r"\1 ", text, flags=re.MULTILINE)
    n_vertices, n_coordinates, first_coordinates, is_mixed = 0, 0, 0, False
    relative_at, indices = -1, [1]
    corners_of: dict[int, int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("v "):
            coordinates = len(line.split()) - 1
            if coordinates < 3:
                raise ValueError(f"line {number}: a vertex of {coordinates} coordinates, not 3")
            first_coordinates = first_coordinates or coordinates
            is_mixed = is_mixed or coordinates != first_coordinates
            n_vertices += 1
            n_coordinates += coordinates
        elif line.startswith("f "):
            if not _OBJ_FACE.fullmatch(line):
                raise ValueError(f"line {number}: not a face of 3 vertices or more: {line[:60]!r}")
            face = [int(index) for index in _OBJ_FIRST_INDEX.findall(line)]
            # Trimesh takes the number of corners from the first face with as many numbers.
            n_numbers = len(line.replace("/", " ").split())
            if corners_of.setdefault(n_numbers, len(face)) != len(face):
                raise ValueError(f"line {number}: faces of two forms are mixed")
            if min(face) < 1:
                if 0 in face or min(face) < -n_vertices:
                    wrong = 0 if 0 in face else min(face)
                    raise ValueError(
                        f"line {number}: a face refers to vertex {wrong}, of {n_vertices} so far"
                    )
                relative_at = n_vertices if relative_at < 0 else relative_at
            indices += (min(face), max(face))
    if not n_vertices:
        raise ValueError("no line is a vertex, 'v x y z'; is it an OBJ file?")
    if is_mixed and n_coordinates == n_vertices * first_coordinates:
        # Trimesh would split the numbers of all vertices into rows as long as the first.
        raise ValueError("vertices have different numbers of coordinates")
    if max(indices) > n_vertices:
        raise ValueError(f"a face refers to vertex {max(indices)}, of {n_vertices} vertices")
    if 0 <= relative_at < n_vertices:
        # Trimesh would count from the end of the file instead.
        raise ValueError("relative indices of faces before the last vertex; write absolute ones")
    return text


def _check_off(text: str) -> None:
    kind, has_kind, text = text.partition("OFF")
    if not has_kind:
        raise ValueError("it does not begin with OFF; is it an OFF file?")
    kind = "".join(line.partition("#")[0] for line in kind.splitlines()).strip()
    if kind not in ("", "C", "N", "CN", "ST"):
        raise ValueError(f"{kind[:20]}OFF is not a kind of OFF with three coordinates")
    (n_vertices, n_faces, *_), *body = _tokens(text) or [["0", "0"]]
    _check_lines(len(body), int(n_vertices), int(n_faces))
    for row in body[int(n_vertices) :]:
        if int(row[0]) < 3:
            raise ValueError(f"not a face of 3 vertices or more: {' '.join(row)[:60]!r}")
        if len(row) <= int(row[0]):
            raise ValueError(f"a face was cut short: {' '.join(row)[:60]!r}")


def _tokens(text: str) -> list[list[str]]:
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return [line for line in lines if line]


def _check_lines(n_lines: int, *expected: int) -> None:
    """Raise ValueError for missing lines, which trimesh ignores, and for surplus lines."""
    if min(expected) < 0:
        raise ValueError(f"the header announces {min(expected)} lines")
    if n_lines < sum(expected):
        raise ValueError(f"{n_lines} of {sum(expected)} lines are there: the file was cut short")
    if n_lines > sum(expected):
        raise ValueError(f"{n_lines} lines are there, the header announces {sum(expected)}")


def _check_ascii_ply(text: str) -> None:
    header, _, text = text.partition("end_header")
    # Name, number of rows and properties of each element.
    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in header.splitlines():
        match line.split():
            case ["element", element, length]:
                elements.append((element, int(length), []))
            case ["property", *words] if elements:
                elements[-1][2].append(words)
    rows = [line.split() for line in text.partition("\n")[2].rstrip().splitlines()]
    _check_lines(len(rows), *(count for _, count, _ in elements))
    n_vertices = sum(count for name, count, _ in elements if name == "vertex")
    start = 0
    for name, count, properties in elements:
        for row in rows[start : start + count]:
            if not _fits(row, properties, n_vertices if name == "face" else None):
                raise ValueError(f"not a {name} as the header describes it: {' '.join(row)[:60]!r}")
        start += count


def _fits(row: list[str], properties: list[list[str]], n_vertices: int | None) -> bool:
    """Return whether a line has the values that its properties require, with valid indices."""
    at = 0
    for words in properties:
        length = 1
        if words[0] == "list":
            if at >= len(row):
                return False
            length = int(row[at])
            at += 1
            is_index = n_vertices is not None and words[-1] in ("vertex_index", "vertex_indices")
            if is_index and not all(0 <= int(i) < (n_vertices or 0) for i in row[at : at + length]):
                return False
        at += length
    return at == len(row)


def _check_list_lengths(elements: Mapping[str, Any]) -> None:
    """Raise ValueError if the lists of a binary PLY element differ in length.

    Trimesh would apply the first length to all.
    """
    for name, element in elements.items():
        data = element.get("data")
        for field in (data.dtype.names or ()) if isinstance(data, np.ndarray) else ():
            values = data[field]
            if values.dtype.names and (values["f0"] != values["f1"].shape[1]).any():
                raise ValueError(f"lists of element {name} have another length than the first")


def _binary_stl_size(data: bytes) -> int:
    return 84 + 50 * int.from_bytes(data[80:84], "little")


_STL_NUMBERS = r"(?:[ \t]+[^\s]+){3}[ \t\r]*\n\s*"
_STL_FACET = re.compile(
    rf"facet[ \t]+normal{_STL_NUMBERS}outer[ \t]+loop[ \t\r]*\n\s*"
    rf"(?:vertex{_STL_NUMBERS}){{3}}endloop[ \t\r]*\n\s*endfacet[ \t\r]*\n",
    re.IGNORECASE,
)
_STL_SOLIDS = re.compile(r"(?:\s*solid\b[^\n]*\n\s*endsolid\b[^\n]*)+\s*", re.IGNORECASE)


def _check_ascii_stl(text: str) -> None:
    # Trimesh takes any three consecutive vertices for a triangle.
    if not _STL_SOLIDS.fullmatch(_STL_FACET.sub("\n", text)):
        raise ValueError("neither a binary STL file nor a whole text of facets of three vertices")


def _check_glb(data: bytes) -> None:
    if len(data) < 20:
        raise ValueError("the file was cut short")
    _, _, length, header_length, _ = struct.unpack("<5I", data[:20])
    if length != len(data):
        raise ValueError(f"{len(data)} bytes are there, the header announces {length}")
    header = json.loads(data[20 : 20 + header_length])
    # Trimesh leaves out unsupported content or fills it with zeros.
    for name in header.get("extensionsRequired", []):
        if not name.startswith(("KHR_materials", "KHR_texture", "EXT_texture")):
            raise ValueError(f"the extension {str(name)[:80]} cannot be read")
    if any("sparse" in accessor for accessor in header.get("accessors", [])):
        raise ValueError("sparse accessors cannot be read")
    modes = {
        part.get("mode", 4) for mesh in header.get("meshes", []) for part in mesh["primitives"]
    }
    if unknown := modes - {0, 1, 2, 3, 4, 5}:
        raise ValueError(f"primitives of mode {min(unknown)} cannot be read")


def main(processor_s: int, clock_s: int, max_bytes: int) -> None:
    """Read the files named on the standard input until it ends, within limits.

    Each line is a path as JSON. The answer is a line of JSON, with the reason of a refusal or the
    numbers of vertices and faces, followed by these arrays as raw float64 and int64.

    Parameters
    ----------
    processor_s, clock_s : int
        Seconds for a file.
    max_bytes : int
        Limit of memory.
    """
    _limit_memory(max_bytes)
    timers = {signal.ITIMER_PROF: processor_s, signal.ITIMER_REAL: clock_s}
    # Without a handler, a timer's signal ends the process even within compiled code.
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
    """Limit this process's memory, if the system supports it."""
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
    # A loader may raise any exception on arbitrary bytes.
    except Exception as error:
        # A reason may quote arbitrary content of the file.
        quoted = "".join(c if c.isprintable() else "?" for c in " ".join(str(error).split()))
        reason = quoted[:300] or type(error).__name__
        return {"refused": f"cannot be read as a mesh ({reason})"}, []
    return {"vertices": len(arrays[0]), "faces": len(arrays[1])}, arrays


def _send(stream: BinaryIO, answer: dict[str, Any], arrays: list[Any]) -> None:
    stream.write(json.dumps(answer).encode() + b"\n")
    for array in arrays:
        stream.write(array.tobytes())
    stream.flush()

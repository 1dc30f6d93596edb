"""Strict readers of mesh files.

OBJ, OFF and PLY, whose faces may be polygons, are read here. STL and GLB are read by trimesh, after
checks for damage that it silently ignores.

A file is read into memory and cannot refer to another file, such as a texture or an external
buffer. As a program, ``python -m nbv.data.mesh_formats``, it is the process of
`nbv.data.mesh_reader`, for a hostile file may exhaust time and memory.
"""

from __future__ import annotations

import io
import itertools
import json
import re
import signal
import struct
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import trimesh

from nbv.data.polygons import triangulate


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
        Any type, with the reason, if the file is damaged or has another format.
    """
    extension, data = path.suffix.lower(), path.read_bytes()
    if not data:
        raise ValueError("the file is empty; at least 1 triangle expected")
    if extension in _POLYGON_READERS:
        vertices, polygons = _POLYGON_READERS[extension](data)
        if not polygons:
            raise ValueError("it holds no mesh; at least 1 triangle expected")
        points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
        indices = np.fromiter(itertools.chain.from_iterable(polygons), dtype=np.int64)
        _check_indices(indices, len(points))
        return trimesh.Trimesh(points, triangulate(points, polygons), process=False)
    if extension == ".stl" and len(data) != _binary_stl_size(data):
        _check_ascii_stl(_decoded(data))
    elif extension == ".glb":
        _check_glb(data)
    # skip_materials: a texture of a few kilobytes may decompress to gigabytes.
    options: dict[str, Any] = {"process": False, "skip_materials": True}
    with warnings.catch_warnings():
        # Before numpy 2.3, text that is not a number only raised a warning and ended the array.
        warnings.filterwarnings("error", message="string or file could not be read")
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=extension.removeprefix("."),
            resolver=_OnlyThisFile(),
            **options,
        )
    for part in scene.geometry.values():
        if isinstance(part, trimesh.Trimesh):
            # After joining, an invalid index would refer to the next part.
            _check_indices(part.faces, len(part.vertices))
    mesh = scene.to_mesh()
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError("it holds no mesh; at least 1 triangle expected")
    return mesh


# Vertices, and the vertex indices of each polygon.
_Polygons = tuple[Sequence[Sequence[float]], Sequence[Sequence[int]]]


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


def _read_obj(data: bytes) -> _Polygons:
    """Return the vertices and the polygons of an OBJ file."""
    vertices, polygons = [], []
    text = _decoded(data).replace("\r\n", "\n").replace("\\\n", "")
    for number, line in enumerate(text.split("\n"), 1):
        match line.split():
            case ["v", *coordinates]:
                if (n := len(coordinates)) < 3:
                    raise ValueError(f"line {number}: a vertex of {n} coordinates, not 3")
                vertices.append([float(coordinate) for coordinate in coordinates[:3]])
            case ["f", *corners]:
                if len(corners) < 3 or not all(map(_OBJ_CORNER.fullmatch, corners)):
                    raise ValueError(
                        f"line {number}: not a face of 3 vertices or more: {line[:60]!r}"
                    )
                face = [int(corner.partition("/")[0]) for corner in corners]
                wrong = min((i for i in face if i < -len(vertices) or i == 0), default=1)
                if wrong < 1:
                    what = f"a face refers to vertex {wrong}, of {len(vertices)} so far"
                    raise ValueError(f"line {number}: {what}")
                # Indices count from 1, negative ones back from the last vertex so far.
                polygons.append([i + len(vertices) if i < 0 else i - 1 for i in face])
    if not vertices:
        raise ValueError("no line is a vertex, 'v x y z'; is it an OBJ file?")
    return vertices, polygons


# v, v/t, v//n or v/t/n; some programs write v/.
_OBJ_CORNER = re.compile(r"-?\d+(?:/(?:-?\d+)?(?:/-?\d+)?)?")


def _read_off(data: bytes) -> _Polygons:
    """Return the vertices and the polygons of an OFF file."""
    kind, has_kind, text = _decoded(data).partition("OFF")
    if not has_kind:
        raise ValueError("it does not begin with OFF; is it an OFF file?")
    kind = "".join(line.partition("#")[0] for line in kind.splitlines()).strip()
    if kind not in ("", "C", "N", "CN", "ST"):
        raise ValueError(f"{kind[:20]}OFF is not a kind of OFF with three coordinates")
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    (n_vertices, n_faces, *_), *body = [line for line in lines if line] or [["0", "0"]]
    _check_lines(len(body), int(n_vertices), int(n_faces))
    vertices, faces = body[: int(n_vertices)], body[int(n_vertices) :]
    for row in (row for row in vertices if len(row) < 3):
        raise ValueError(f"not a vertex of 3 coordinates: {' '.join(row)[:60]!r}")
    for row in (row for row in faces if not 3 <= int(row[0]) < len(row)):
        raise ValueError(f"not a whole face of 3 vertices or more: {' '.join(row)[:60]!r}")
    polygons = [[int(index) for index in row[1 : int(row[0]) + 1]] for row in faces]
    return [[float(x) for x in row[:3]] for row in vertices], polygons


def _check_lines(n_lines: int, *expected: int) -> None:
    """Raise ValueError unless a text has as many lines as its header announces."""
    if n_lines != sum(expected) or min(expected) < 0:
        cut = ": the file was cut short" if n_lines < sum(expected) else ""
        raise ValueError(f"{n_lines} lines are there, the header announces {sum(expected)}{cut}")


# The format characters of `struct`.
_PLY_KINDS = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"},
    **{"int64": "q", "uint64": "Q", "float16": "e", "float32": "f", "float64": "d"},
    **{"float": "f", "double": "d"},
}

# Name, number of rows, and name, kind and kind of the length (empty: no list) of each property.
_Element = tuple[str, int, list[tuple[str, str, str]]]
_Row = tuple[str, Mapping[str, Sequence[Any]]]


def _read_ply(data: bytes) -> _Polygons:
    """Return the vertices and the polygons of a PLY file."""
    header, has_end, rest = data.partition(b"end_header")
    if not (header.startswith(b"ply") and has_end):
        raise ValueError("it has no header from ply to end_header; is it a PLY file?")
    order, elements = "", list[_Element]()
    for line in _decoded(header).splitlines():
        match line.split():
            case ["format", form, *_]:
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", length, kind, name] if elements:
                elements[-1][2].append((name, _PLY_KINDS[kind], _PLY_KINDS[length]))
            case ["property", kind, name] if elements:
                elements[-1][2].append((name, _PLY_KINDS[kind], ""))
    body = rest.partition(b"\n")[2]
    rows = list(_ply_bytes(body, elements, order) if order else _ply_text(body, elements))
    vertices = [[row[axis][0] for axis in "xyz"] for name, row in rows if name == "vertex"]
    faces = (row for name, row in rows if name == "face")
    polygons = [row.get("vertex_indices") or row.get("vertex_index") or () for row in faces]
    for i, face in enumerate(polygons):
        if len(face) < 3 or isinstance(face[0], float):
            raise ValueError(f"face {i} has not 3 vertex_indices or more")
    return vertices, polygons


def _ply_text(body: bytes, elements: list[_Element]) -> Iterator[_Row]:
    """Yield the rows of a text: the name of the element, and the values of each property."""
    lines = body.decode("utf-8").rstrip().splitlines()
    _check_lines(len(lines), *(count for _, count, _ in elements))
    described = ((name, properties) for name, n, properties in elements for _ in range(n))
    for line, (name, properties) in zip(lines, described, strict=True):
        words, row, is_short = line.split()[::-1], {}, False
        try:
            for key, kind, length in properties:
                number = float if kind in "efd" else int
                row[key] = [number(words.pop()) for _ in range(int(words.pop()) if length else 1)]
        except IndexError:
            is_short = True
        if words or is_short:
            raise ValueError(f"not a {name} as the header describes it: {line[:60]!r}")
        yield name, row


def _ply_bytes(body: bytes, elements: list[_Element], order: str) -> Iterator[_Row]:
    """Yield the rows of a binary file, as `_ply_text` does."""
    at = 0

    def take(form: str) -> tuple[Any, ...]:
        nonlocal at
        at += struct.calcsize(form)
        if at > len(body):
            raise ValueError("the file was cut short, or a list has another length than it says")
        return struct.unpack_from(form, body, at - struct.calcsize(form))

    for name, count, properties in elements:
        for _ in range(count):
            row = {}
            for key, kind, length in properties:
                row[key] = take(f"{order}{take(order + length)[0] if length else 1}{kind}")
            yield name, row
    if at != len(body):
        raise ValueError(f"{len(body)} bytes are there, the header and the lists announce {at}")


_POLYGON_READERS = {".obj": _read_obj, ".off": _read_off, ".ply": _read_ply}


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
    """Read the files named on the standard input until it ends, within the limits of `MeshReader`.

    Each line is a path as JSON. The answer is a line of JSON, with the reason of a refusal or the
    numbers of vertices and faces, followed by these arrays as raw float64 and int64.
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
        sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")
        for array in arrays:
            sys.stdout.buffer.write(array.tobytes())
        sys.stdout.buffer.flush()


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
        words = f"no {error}" if isinstance(error, KeyError) else str(error)
        quoted = "".join(c if c.isprintable() else "?" for c in " ".join(words.split()))
        reason = quoted[:300] or type(error).__name__
        return {"refused": f"cannot be read as a mesh ({reason})"}, []
    return {"vertices": len(arrays[0]), "faces": len(arrays[1])}, arrays

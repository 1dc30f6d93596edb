"""Limits of time and memory for a mesh file, and what is no file."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import psutil
import pytest
import trimesh

from mesh_files import READER, put, refused
from nbv.data.mesh_formats import parse_mesh
from nbv.data.mesh_reader import MeshReader


def test_a_mesh_comes_as_it_was_parsed(tmp_path):
    path = put(tmp_path / "one.ply")
    read, parsed = READER.read(path), parse_mesh(path)
    assert np.array_equal(read.vertices, parsed.vertices)
    assert np.array_equal(read.faces, parsed.faces)


def test_what_is_no_regular_file_is_refused_before_it_is_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "link.obj").symlink_to("/dev/zero")
    for name in ("pipe", "link"):
        path = tmp_path / f"{name}.obj"
        refused(lambda path=path: READER.read(path), path, "is not a regular file")
    refused(lambda: READER.read(tmp_path / "none.obj"), "does not exist")


@pytest.mark.slow
def test_a_file_that_takes_too_long_is_named_with_the_limit(tmp_path):
    path = tmp_path / "slow.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 1_000_000)
    reader = MeshReader(processor_s=1)
    refused(lambda: reader.read(path), path, "took more than 1 s of processor time")
    assert len(reader.read(put(tmp_path / "next.ply")).faces) == 24


def test_a_file_that_needs_too_much_memory_is_named_with_the_limit(tmp_path):
    resource = pytest.importorskip("resource")
    assert resource.RLIMIT_AS
    path = tmp_path / "large.stl"
    with path.open("wb") as file:
        file.truncate(8 * 2**30)  # of zeros that take no room on the disk
    reader = MeshReader(max_bytes=2**31)
    refused(lambda: reader.read(path), path, "needs more than 2 GiB of memory")
    assert len(reader.read(put(tmp_path / "next.ply")).faces) == 24


def test_a_reader_that_is_killed_is_named_and_started_again(tmp_path):
    path = tmp_path / "slow.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 1_000_000)
    others = children()
    reader = MeshReader()
    reader.read(put(tmp_path / "first.ply"))
    (child,) = children() - others
    threading.Timer(0.5, os.kill, (child, signal.SIGKILL)).start()
    refused(lambda: reader.read(path), path, "SIGKILL")
    assert len(reader.read(tmp_path / "first.ply").faces) == 24


def children():
    return {child.pid for child in psutil.Process().children()}


def test_the_process_ends_with_the_reader(tmp_path):
    others = children()
    reader = MeshReader()
    reader.read(put(tmp_path / "one.ply"))
    (child,) = children() - others
    del reader
    # Readers of other tests may end meanwhile.
    assert child not in children()


def test_the_process_ends_with_the_one_that_started_it(tmp_path):
    program = (
        "import os, sys; from pathlib import Path; from nbv.data.mesh_reader import MeshReader\n"
        f"reader = MeshReader(); reader.read(Path({str(put(tmp_path / 'one.ply'))!r}))\n"
        "print(reader._process.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, check=False)
    child = int(done.stdout)
    deadline = time.monotonic() + 60
    while is_running(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(child)


def is_running(pid):
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


def test_names_of_any_bytes_are_read(tmp_path):
    for name in (b"a, 'b' \"c\" {d} %e.ply", b"latin \xe9.ply", b"two\nlines.ply"):
        path = tmp_path / os.fsdecode(name)
        path.write_bytes(trimesh.creation.box().export(file_type="ply"))
        assert len(READER.read(path).faces) == 12

"""The depth images of many objects in one file, and their ids."""

import itertools
import logging
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.data.depth_images import DepthImages, open_depth, write_depth
from nbv.errors import UserError
from nbv.files import write_json

NAMES = ["b", "a", "007"]
IMAGES = np.random.default_rng(0).integers(0, 256, (3, 12, 8, 8), dtype=np.uint8)


def write(folder, names=NAMES, images=IMAGES):
    paths = folder / "depth" / "el15.npy", folder / "depth" / "el15_objects.json"
    write_depth(*paths, names, iter(images), images.shape[1:])
    return paths


def test_images_and_objects_come_back_in_their_order(tmp_path):
    paths = write(tmp_path)
    read = open_depth(*paths)
    assert read.object_ids == tuple(NAMES)
    assert isinstance(read.codes, np.memmap)
    assert not read.codes.flags.writeable
    np.testing.assert_array_equal(read.codes, IMAGES)
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == [p.name for p in paths]


@given(st.permutations(NAMES), st.integers(0, 3))
def test_images_are_found_by_name_whatever_the_order(order, n):
    images = DepthImages(tuple(NAMES), IMAGES)
    for name, found in zip(order[:n], images.of(order[:n]), strict=True):
        np.testing.assert_array_equal(found, IMAGES[NAMES.index(name)])


def test_an_object_without_images_is_named():
    with pytest.raises(UserError, match="'c' has no depth images"):
        DepthImages(tuple(NAMES), IMAGES).of(["a", "c"])


def test_the_same_images_make_the_same_bytes(tmp_path):
    one, two = write(tmp_path / "one"), write(tmp_path / "two")
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]


def test_an_error_while_rendering_leaves_what_was_there(tmp_path):
    paths = write(tmp_path)
    before = [path.read_bytes() for path in paths]

    def broken():
        yield IMAGES[0]
        raise UserError("huge: the object leaves the image")

    with pytest.raises(UserError, match=r"^huge"):
        write_depth(*paths, NAMES, broken(), IMAGES.shape[1:])
    assert [path.read_bytes() for path in paths] == before


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["b", "a"], "2 different objects, .* has images of 3"),
        (["b", "a", 7], "holds no list of objects"),
    ],
)
def test_ids_that_do_not_fit_the_images_are_refused(tmp_path, names, message):
    path, objects = write(tmp_path)
    write_json(objects, names)
    with pytest.raises(UserError, match=rf"el15_objects\.json: {message}"):
        open_depth(path, objects)


def test_a_damaged_file_is_named(tmp_path):
    path, objects = write(tmp_path)
    whole = path.read_bytes()
    for content in (b"", whole[:50], whole[:-1], b"PK" + whole):
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"el15\.npy: .*run the same command again"):
            open_depth(path, objects)
    np.save(path, IMAGES[0])
    with pytest.raises(UserError, match="holds no depth images"):
        open_depth(path, objects)


def test_progress_is_logged_with_the_time_left(tmp_path, caplog, monkeypatch):
    monkeypatch.setattr(time, "monotonic", itertools.count(step=10.0).__next__)
    names = [f"{index}" for index in range(20)]
    with caplog.at_level(logging.INFO, logger="nbv"):
        write(tmp_path, names, np.zeros((20, 2, 8, 8), np.uint8))
    lines = [record.message for record in caplog.records]
    assert len(lines) == 20
    assert lines[0].endswith("el15.npy, sweeps of 2 images: 1 of 20, 190 s left")
    assert lines[-1].endswith(": 20 in 210.0 s")

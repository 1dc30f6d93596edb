import errno
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nbv import files
from nbv.errors import UserError


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    target = tmp_path / "deep" / "table.csv"
    files.write_text(target, "old")

    def write_half():
        with files.replacing(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write_half()
    assert target.read_text() == "old"
    assert [path.name for path in target.parent.iterdir()] == ["table.csv"]


def test_arrays_come_back_and_have_the_same_bytes_twice(tmp_path):
    arrays = {"a": np.arange(5, dtype=np.float32), "setting": np.asarray(2.5)}
    files.write_arrays(tmp_path / "one.npz", arrays)
    files.write_arrays(tmp_path / "two.npz", arrays)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    stored = files.read_arrays(tmp_path / "one.npz")
    np.testing.assert_array_equal(stored["a"], arrays["a"])
    assert stored["setting"] == 2.5


def test_csv_rounds_floats_and_leaves_absent_values_empty(tmp_path):
    frame = pd.DataFrame({"x": [1.23456, np.nan], "n": [1, 2]})
    files.write_csv(tmp_path / "t.csv", frame)
    assert (tmp_path / "t.csv").read_bytes() == b"x,n\n1.2346,1\n,2\n"


def test_whoever_writes_the_same_file_later_is_the_one_who_does(tmp_path):
    """A job whose run was killed loses its temporary file to the job of the next run."""
    target = tmp_path / "a[1].csv"

    def orphan():
        with files.replacing(target) as temporary:
            temporary.write_text("orphan")
            files.write_text(target, "new")

    with pytest.raises(FileNotFoundError):
        orphan()
    assert target.read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def test_a_file_that_cannot_be_written_is_named_as_it_was_given(tmp_path):
    def full_disk(temporary):
        raise OSError(errno.ENOSPC, "No space left on device")

    def full_disk_of_numpy(temporary):
        raise OSError("9 requested and 0 written")

    def of_another_file(temporary):
        raise PermissionError(errno.EACCES, "Permission denied", "other")

    # There is place for this name, but for none that is longer.
    long = tmp_path / f"{'a' * 250}.csv"
    folder = tmp_path / "folder"
    folder.mkdir()
    for target, write, named in (
        (long, Path.touch, str(long)),
        (folder, Path.touch, str(folder)),
        (tmp_path / "a.csv", full_disk, str(tmp_path / "a.csv")),
        (tmp_path / "a.csv", full_disk_of_numpy, str(tmp_path / "a.csv")),
        (tmp_path / "a.csv", of_another_file, "other"),
    ):
        with pytest.raises(OSError) as error, files.replacing(target) as temporary:
            write(temporary)
        assert error.value.filename == named
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\xff\xfe\x00", b"a,b\n1,2,3\n"])
@pytest.mark.parametrize("read", [files.read_arrays, files.open_array, files.read_json])
def test_a_damaged_file_is_one_line_that_names_it(tmp_path, content, read):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"file: cannot be read .* run the same command again") as e:
        read(path)
    assert len(str(e.value).splitlines()) == 1


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"a,b\n1,2\n1,2,3\n"])
def test_a_damaged_table_is_one_line_that_names_it(tmp_path, content):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"t\.csv: cannot be read"):
        files.read_csv(path)


def test_a_missing_array_is_named(tmp_path):
    files.write_arrays(tmp_path / "a.npz", {"x": np.arange(3)})
    with pytest.raises(UserError, match=r"a\.npz: holds no array 'y'"):
        files.read_arrays(tmp_path / "a.npz", ("x", "y"))
    with pytest.raises(UserError, match=r"b\.npz does not exist"):
        files.read_arrays(tmp_path / "b.npz")


def test_a_pipe_exists_and_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    kinds = {"pipe": "is not a regular file", "folder": "is a folder", "none": "does not exist"}
    for name, what in kinds.items():
        path = tmp_path / f"{name}.csv"
        for read in (files.read_numbers, files.existing, lambda path: files.read_rows(path, ["a"])):
            with pytest.raises(UserError, match=rf"{path} {what}"):
                read(path)


TABLE = "object_id,R_true,t\nNA,1 2,3\n7,4 5,6\n"


@pytest.mark.parametrize(
    "text",
    [
        TABLE.replace(",", ", ").replace("\n", " \n"),
        TABLE.replace("object_id,R_true,t", "Object_ID,r_TRUE,T"),
        "# by hand\n# me, you, them\n" + TABLE,
        "# by hand\n# " + TABLE,
        TABLE.replace("1 2", '" 1 2"'),
    ],
)
def test_spaces_capitals_and_comments_of_a_table_do_not_count(tmp_path, text):
    for name, content in (("plain.csv", TABLE), ("t.csv", text)):
        (tmp_path / name).write_text(content)
    needed = ["object_id", "R_true", "t"]
    plain, read = (files.read_rows(tmp_path / n, needed) for n in ("plain.csv", "t.csv"))
    pd.testing.assert_frame_equal(read, plain)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a,A,b,B,c\n1,2,3,4,5\n", "no column 'object_id'"),
        (b"object_id,azimut,t\na,2,3\n", "no column 'azimuth'.* is it 'azimut'"),
        (b"mug,1,2\nmug,1,2\n", "row 1 holds numbers: put a row of these names above"),
        (b"1,1,1 2 3,-1e3\n1,1,1 2 3,4\n", "row 1 holds numbers"),
        (b"object_id, object_id\n1,2\n", "two columns 'object_id'"),
        (b"\x93NUMPY\x01\x00", "arrays of numpy"),
    ],
)
def test_a_head_that_is_none_is_told(tmp_path, content, message):
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(UserError, match=rf"t\.csv.*{message}"):
        files.read_rows(tmp_path / "t.csv", ["object_id", "azimuth"])


def test_a_key_that_is_there_twice_is_named(tmp_path):
    (tmp_path / "m.json").write_text('{"1": {"b": 2, "a": 1, "b": 3}}')
    with pytest.raises(UserError, match=r"m\.json: the key 'b' is there twice"):
        files.read_given_json(tmp_path / "m.json", "give JSON")


def test_pickled_objects_are_told_from_other_files(tmp_path):
    np.save(tmp_path / "p.npy", np.array([{"R": 1}], dtype=object))
    with pytest.raises(UserError, match=r"p\.npy cannot be read \(it holds Python objects"):
        files.read_numbers(tmp_path / "p.npy")

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nbv import files


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

from __future__ import annotations

import numpy as np
import pytest

from nbv.core.estimates import Estimates
from nbv.errors import UserError
from nbv.experiment.estimates import read_estimates, write_estimates


def test_estimates_come_back_to_four_decimals(tmp_path):
    rng = np.random.default_rng(0)
    estimate = rng.uniform(0, 360, (3, 360))
    estimate[0, 0] = 359.99999  # would be printed as 360.0
    write_estimates(tmp_path / "e.csv", Estimates(("null", "NA", "007"), estimate))
    header = (tmp_path / "e.csv").read_text().splitlines()[0]
    assert header == "object_id,azimuth_deg,estimate_deg"
    read = read_estimates(tmp_path / "e.csv")
    assert read.object_ids == ("null", "NA", "007")
    assert read.estimate_deg[0, 0] == 0.0
    np.testing.assert_allclose(read.estimate_deg.ravel()[1:], estimate.ravel()[1:], atol=5.1e-5)
    np.testing.assert_array_equal(read.azimuth_deg, np.arange(360))


def test_a_missing_view_is_refused(tmp_path):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a",), np.zeros((1, 360))))
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:50] + lines[51:]) + "\n")
    with pytest.raises(UserError, match="full turn"):
        read_estimates(path)


def test_a_missing_column_is_refused(tmp_path):
    (tmp_path / "e.csv").write_text("object_id,azimuth_deg\na,0\n")
    with pytest.raises(UserError, match="no column 'estimate_deg'"):
        read_estimates(tmp_path / "e.csv")


@pytest.mark.parametrize("value", ["", "nan", "inf", "-0.1", "360.0", "1e300", "abc"])
def test_an_estimate_that_is_no_azimuth_is_refused(tmp_path, value):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a", "b"), np.full((2, 4), 7.5)))
    lines = path.read_text().splitlines()
    lines[3] = f"a,2,{value}"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(UserError, match=r"e\.csv: .*; delete the file"):
        read_estimates(path)


def test_a_row_of_another_object_is_refused(tmp_path):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a", "b"), np.full((2, 4), 7.5)))
    path.write_text(path.read_text().replace("a,2", "b,2"))
    with pytest.raises(UserError, match="full turn"):
        read_estimates(path)


def test_further_columns_of_older_files_are_ignored(tmp_path):
    path = tmp_path / "e.csv"
    write_estimates(path, Estimates(("a",), np.full((1, 4), 7.0)))
    header, *rows = path.read_text().splitlines()
    older = [f"{header},concentration", *(f"{row},0.5" for row in rows)]
    path.write_text("\n".join(older) + "\n")
    np.testing.assert_array_equal(read_estimates(path).estimate_deg, np.full((1, 4), 7.0))

from __future__ import annotations

import pandas as pd
import pytest

from nbv.experiment.report.extensions.view_sphere import view_sphere_table
from nbv.experiment.statistics.paired import Resampler

from .made import texts

ERRORS = {
    (0, "opposite"): 9.0,
    (0, "information_gain_circle"): 8.0,
    (0, "information_gain_sphere"): 5.0,
    (30, "opposite"): 6.0,
    (30, "information_gain_circle"): 4.0,
    (30, "information_gain_sphere"): 4.5,
}


def test_the_sphere_is_compared_with_the_circle_by_the_first_elevation():
    rows = pd.DataFrame(
        [
            (method, elevation, f"{k:02d}", 1, error + k / 10, 100.0, 15.0)
            for (elevation, method), error in ERRORS.items()
            for k in range(11)
        ],
        columns=[
            *("method", "elevation_deg", "object_id", "fold", "error_deg", "travel_deg"),
            "next_elevation_deg",
        ],
    )
    table = view_sphere_table(rows, "mug", Resampler(0, 200))
    assert table.header == (
        *("First elevation", "Opposite", "Information gain: circle → sphere", "difference"),
    )
    assert texts(table) == {
        "0°": ["9.50", "8.50 → 5.50", "−3.00 (−3.00 to −3.00)"],
        "30°": ["6.50", "4.50 → 5.00", "0.50 (0.50 to 0.50)"],
    }
    assert [row[-1].after for row in table.rows] == ["*", "*"]
    cells = table.cells.set_index(["elevation_deg", "method"])
    for key, error in ERRORS.items():
        assert cells.loc[key, "value"] == pytest.approx(error + 0.5)
        assert cells.loc[key, "next_elevation_deg"] == 15

"""More views and the view sphere as tables."""

from __future__ import annotations

import pandas as pd
import pytest

from nbv.reporting import sheets
from nbv.reporting.grid import grid_markdown
from nbv.statistics.paired import Resampler


def test_more_views_are_compared_with_four_random_ones():
    rows = pd.DataFrame(
        [
            (method, views, f"{k}", base / views + k, 90.0 * (views - 1))
            for method, base in (("random", 12.0), ("bisecting", 8.0))
            for views in (1, 2, 3, 4)
            for k in range(6)
        ],
        columns=["method", "n_views", "object_id", "error_deg", "travel_deg"],
    )
    sheet = sheets.sequence_sheet({"mug": rows.assign(fold=1)}, Resampler(0, 200))
    assert "4 views" in grid_markdown(sheet.title, sheet.grid, sheet.notes)
    three = sheet.cells[(sheet.cells["method"] == "bisecting") & (sheet.cells["n_views"] == 3)]
    assert three["to_random_4"].iloc[0] == pytest.approx(8.0 / 3 - 12.0 / 4)


def test_the_view_sphere_has_a_row_for_each_first_elevation():
    rows = pd.DataFrame(
        [
            (method, elevation, f"{k}", 5.0 + k, 90.0, elevation)
            for method in ("opposite", "information_gain_circle", "information_gain_sphere")
            for elevation in (0, 30)
            for k in range(6)
        ],
        columns=[
            *("method", "elevation_deg", "object_id"),
            *("error_deg", "travel_deg", "next_elevation_deg"),
        ],
    )
    sheet = sheets.sphere_sheet(rows.assign(fold=1), "mug", Resampler(0, 200))
    assert len(sheet.grid.rows) == 2

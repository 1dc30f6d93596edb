from __future__ import annotations

import pandas as pd
import pytest
from studies.more_views_table import more_views_table

from nbv.experiment.statistics.paired import Resampler

from .made import texts


def rows_of(errors, n_objects=12):
    """Rows of `experiments.more_views`: each object errs by its number less or more."""
    return pd.DataFrame(
        [
            (method, n_views, f"{k:02d}", 1 + k % 2, error + k / 10, 60.0 * (n_views - 1))
            for (method, n_views), error in errors.items()
            for k in range(n_objects)
        ],
        columns=["method", "n_views", "object_id", "fold", "error_deg", "travel_deg"],
    )


ERRORS = {("random", n): 12.0 - n for n in (1, 2, 3, 4)} | {
    ("information_gain", n): 10.0 - n for n in (1, 2, 3, 4)
}


def test_error_and_travel_by_views_and_three_views_compared_with_four_at_random():
    table = more_views_table({"mug": rows_of(ERRORS)}, Resampler(0, 200))
    assert table.header == (
        *("Policy", "1 view", "2 views", "3 views", "4 views"),
        "3 views − Random's 4",
    )
    shift = 0.55  # of the mean object
    gain = texts(table)["Mug: Information gain"]
    assert gain == [*(f"{10 - n + shift:.2f}" for n in (1, 2, 3, 4)), "−1.00 (−1.00 to −1.00)"]
    assert [cell.after for cell in table.rows[1][1:5]] == ["[0°]", "[60°]", "[120°]", "[180°]"]
    assert texts(table)["Mug: Random"][-1] == "–"
    assert [row[-1].after for row in table.rows] == ["", "*"]
    cells = table.cells.set_index(["method", "n_views"])
    assert cells.loc[("information_gain", 3), "to_random_4"] == pytest.approx(-1.0)
    assert cells["to_random_4"].notna().sum() == 1
    assert cells.loc[("random", 4), "travel_deg"] == 180


def test_a_policy_that_takes_fewer_views_has_dashes():
    few = {key: error for key, error in ERRORS.items() if key[0] == "random" or key[1] < 3}
    table = more_views_table({"mug": rows_of(few)}, Resampler(0, 200))
    assert texts(table)["Mug: Information gain"][2:] == ["–", "–", "–"]
    assert "to_random_4" not in table.cells.columns

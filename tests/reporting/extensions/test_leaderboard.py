from __future__ import annotations

import numpy as np
import pandas as pd

from nbv.reporting.extensions import leaderboard
from nbv.statistics.object_means import OBJECT_COLUMNS
from nbv.statistics.paired import Resampler


def test_bold_only_where_the_interval_says_so():
    rng = np.random.default_rng(0)
    rows = []
    for category, offset in (("clear", 3.0), ("close", 0.05)):
        for method, shift in (("opposite", offset), ("proposed", offset), ("selected", 0.0)):
            noise = rng.normal(0, 0.5, 30)
            rows += [
                (category, 0, 1 + k % 5, method, f"{k:02d}", 360, 10 + shift + noise[k], 90.0)
                for k in range(30)
            ]
    columns = ["category", "elevation_deg", "fold", *OBJECT_COLUMNS]
    blocks = leaderboard.blocks_of({"run": pd.DataFrame(rows, columns=columns)})
    sheet = leaderboard.leaderboard(blocks, Resampler(0, 500))
    text = {row[0].text: row for row in sheet.grid.rows}
    assert text["selected"][1].best
    assert not text["selected"][2].best
    assert "*" in text["selected"][2].text
    assert sheet.grid.rows[0][0].text == "selected"


def test_the_favoured_pair_has_the_least_validated_error_over_categories():
    rows = pd.DataFrame(
        [
            ("mug", "a", "fixed", 4.0),
            ("mug", "b", "expected_error", 6.0),
            ("car", "a", "fixed", 9.0),
            ("car", "b", "expected_error", 6.0),
            ("car", "b", "expected_error", 8.0),
            ("car", "chosen", "fixed", 0.0),
            ("car", "oracle_average", "oracle", 0.0),
            ("car", "random_posterior", "random", 0.0),
        ],
        columns=["category", "method", "rotation", "validated_error_deg"],
    )
    only_mug_and_car = rows[rows["method"].isin(["a", "b"])]
    assert leaderboard.favoured({"one": only_mug_and_car, "two": rows}) == {"one": "a", "two": "a"}
    dearer = rows.assign(validated_error_deg=rows["validated_error_deg"] + (rows["method"] == "a"))
    assert leaderboard.favoured({"run": dearer}) == {"run": "b"}

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nbv.experiments.ablation import ablation_space
from nbv.reporting.extensions import ablation as ablation_table
from nbv.statistics.paired import Resampler


def test_the_ablation_compares_each_row_with_the_first():
    rng = np.random.default_rng(0)
    space = ablation_space().iloc[:3]
    base = rng.uniform(5, 10, 40)
    found = {
        row: pd.DataFrame(
            {"object_id": [f"{k:02d}" for k in range(40)], "fold": 1, "error_deg": base + shift}
        )
        for row, shift in enumerate((0.0, -1.0, 1.0))
    }
    sheet = ablation_table.ablation_sheet(space, found, "mug", Resampler(0, 200))
    assert sheet.cells["difference"].tolist() == pytest.approx([0.0, -1.0, 1.0])
    assert [row[3].best for row in sheet.grid.rows] == [False, True, False]

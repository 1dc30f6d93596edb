from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from studies.ablation import ablation_space
from studies.ablation_table import ablation_table

from nbv.experiment.statistics.paired import Resampler


def test_each_row_is_compared_with_the_first():
    space = ablation_space()
    base = np.random.default_rng(0).uniform(5, 10, 40)
    shifts = np.linspace(0.0, 1.0, len(space))
    shifts[1] = -1.0
    found = {
        row: pd.DataFrame(
            {"object_id": [f"{k:02d}" for k in range(40)], "fold": 1, "error_deg": base + shift}
        )
        for row, shift in enumerate(shifts)
    }
    table = ablation_table(space, found, "mug", Resampler(0, 200))
    assert table.cells["difference"].tolist() == pytest.approx(list(shifts))
    assert table.cells["value"].tolist() == pytest.approx(list(base.mean() + shifts))
    assert list(table.cells.columns[: space.shape[1]]) == list(space.columns)
    assert [row[3].after for row in table.rows] == ["*" if shift else "" for shift in shifts]
    assert [cell.text for cell in table.rows[0]][:2] == ["nothing", "the paper's method"]
    assert table.rows[0][3].text == "–"
    # A line says what it changes: no two say the same.
    described = [(row[0].text, row[1].text) for row in table.rows]
    assert len(set(described)) == len(described)

import numpy as np
import pandas as pd
import pytest
from studies.ablation import PAPER, ablate, ablation_space, ablation_table
from studies.extensions import evaluate_extensions

from made_estimates import FEW_DENSITIES, objects
from nbv.experiment.statistics.paired import Resampler


def test_the_first_row_is_the_papers_method_and_every_other_changes_it():
    space = ablation_space()
    assert dict(space.iloc[0].drop("varied")) == dict(PAPER)
    assert not space.drop(columns="varied").duplicated().any()
    calibration, test = objects(6, 0), objects(5, 1)
    plain = ablate(calibration, test, PAPER, FEW_DENSITIES)
    method = {"paper": {"policy": "pose_ambiguity", "fusion": "average"}}
    frame = evaluate_extensions(
        calibration, test, method, FEW_DENSITIES, lambda name: np.random.default_rng(0)
    ).frames["paper"]
    expected = frame.groupby("object_id")["error_deg"].mean()
    np.testing.assert_allclose(plain.set_index("object_id")["error_deg"], expected, atol=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"chosen_by": "given", "bandwidth_deg": 6.0, "pseudo_observations": 10.0},
        {"chosen_by": "likelihood"},
        {"n_bins": 72},
        {"n_calibration": 2},
        {"criterion": "expected_error", "fusion": "posterior"},
    ],
)
def test_every_kind_of_ablation_gives_an_error_for_each_object(change):
    calibration, test = objects(6, 0), objects(5, 1)
    found = ablate(calibration, test, {**PAPER, **change}, FEW_DENSITIES)
    assert found["object_id"].tolist() == list(test.object_ids)
    assert found["error_deg"].between(0, 60).all()


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

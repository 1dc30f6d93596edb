"""The target `transfer` of the studies' Snakefile, run small."""

import re

import numpy as np
import pandas as pd
import pytest

from projects import TINY

from .conftest import STUDIED

pytestmark = pytest.mark.slow

PLACE = "mug/el00/fold2"


def test_trained_on_and_tested_on(studied):
    results = studied.results
    made = sorted(
        str(path.relative_to(results)) for path in results.glob("transfer/*/depth/*/*.npy")
    )
    assert made == ["transfer/kinect/depth/mug/el00.npy"]  # ideal is the run's own condition
    clean, noisy = (
        np.load(results / name, mmap_mode="r") for name in ("depth/mug/el00.npy", made[0])
    )
    lost = (clean > 0) & (noisy == 0)
    assert 0.01 < lost.sum() / (clean > 0).sum() < 0.5
    assert not (results / "transfer/ideal/estimators").exists()

    cells = pd.read_csv(results / "tables/transfer.csv").set_index(
        ["trained_on", "tested_on", "method"]
    )
    assert len(cells) == 2 * 2 * 4
    for (trained, tested, method), cell in cells.iterrows():
        errors = pd.read_csv(
            results / f"transfer/{trained}/{tested}/evaluation/{PLACE}/{method}.csv"
        )["error_deg"]
        assert cell["value"] == pytest.approx(errors.mean(), abs=1e-3)
    for method in ("single", "opposite", "proposed"):
        ours = results / f"transfer/ideal/ideal/evaluation/{PLACE}/{method}.csv"
        assert ours.read_bytes() == (results / f"evaluation/{PLACE}/{method}.csv").read_bytes()

    text = (results / "tables/transfer.md").read_text()
    assert len(re.findall(r"^\| (Single|Random|Opposite|Proposed) \|", text, re.M)) == 8
    # The run itself is as finished as it was, and a size concerns its own sensor and category.
    more = (*STUDIED[len(TINY) :], "categories=[mug]", "sensor.diagonal_m.mug=0.3")
    assert studied.would_run(*more, targets=("evaluation",)) == {"settings": 1, "evaluation": 1}

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nbv.statistics.object_means import object_means


def test_object_means_are_plain_means():
    rng = np.random.default_rng(0)
    frame = pd.DataFrame(
        {
            "object_id": np.repeat(["a", "b"], 10),
            "error_deg": rng.uniform(0, 90, 20),
            "delta_deg": rng.integers(0, 360, 20),
        }
    )
    means = object_means({"m": frame}).set_index(["method", "object_id"])
    mine = frame[frame["object_id"] == "b"]
    assert means.loc[("m", "b"), "error_deg"] == pytest.approx(mine["error_deg"].mean())
    shorter = np.minimum(mine["delta_deg"], 360 - mine["delta_deg"]).mean()
    assert means.loc[("m", "b"), "travel_deg"] == pytest.approx(shorter)
    assert means.loc[("m", "b"), "n_images"] == 10

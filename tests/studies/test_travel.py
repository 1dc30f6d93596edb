from __future__ import annotations

import pandas as pd
import pytest
from studies.travel import pooled_travel, travel_rows

from nbv.core.policies import TestViews as Views
from nbv.core.policies import two_views
from nbv.core.selection import select_methods
from tests.core.made import EXTENSIONS, FEW_DENSITIES, objects


def test_travel_curves_start_at_the_table_and_end_by_staying():
    test, selected = objects(5, 1), select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES)
    rows = travel_rows(selected, test)
    gain = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "cost")]
    first, last = gain.iloc[0], gain.iloc[-1]
    # The first extension with posterior fusion gives the density of the fixed rotations.
    views, fixed = (
        Views(test.estimate_deg, selected[name].evidence)
        for name in ("gain_posterior", "random_posterior")
    )
    error = two_views("information_gain", "posterior", views).error_deg.mean()
    assert first["error_deg"] == pytest.approx(error, abs=1e-3)
    assert last["travel_deg"] < first["travel_deg"]
    assert gain["travel_deg"].is_monotonic_decreasing
    limits = rows[(rows["method"] == "gain_posterior") & (rows["rule"] == "limit")]
    assert (limits["travel_deg"] <= limits["setting"]).all()
    opposite = rows[(rows["rule"] == "fixed") & (rows["setting"] == 180)]
    by_name = opposite.set_index("method")["error_deg"]
    expected = two_views("opposite", "posterior", fixed).error_deg.mean()
    assert by_name["either_way_posterior"] == pytest.approx(expected, abs=1e-3)


def test_pooled_travel_weighs_folds_by_their_images():
    rows = pd.DataFrame(
        {
            "method": "m",
            "rule": "cost",
            "setting": [0.0, 1.0],
            "travel_deg": [100.0, 0.0],
            "error_deg": [4.0, 8.0],
            "n_images": 10,
        }
    )
    other = rows.assign(error_deg=[1.0, 2.0], n_images=30)
    pooled = pooled_travel({1: rows, 2: other})
    assert pooled["error_deg"].tolist() == [(4 + 3) / 4, (8 + 6) / 4]

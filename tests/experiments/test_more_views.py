from __future__ import annotations

import numpy as np
import pytest
from tests.recommendation.made import EXTENSIONS, FEW_DENSITIES, objects

from nbv.experiments.extensions import choices_frame, stored_evidence
from nbv.experiments.more_views import more_views_rows
from nbv.recommendation.method_selection import select_methods

SETTINGS = {"n_views": 4, "start_every_deg": 60, "min_separation_deg": 15}
WITH_THE_PAPERS = EXTENSIONS | {
    "ambiguity_posterior": {"policy": "pose_ambiguity", "fusion": "posterior"},
    "error_posterior": {"policy": "expected_error", "fusion": "posterior"},
}


@pytest.fixture(scope="module")
def rows():
    calibration = objects(6, 0)
    choices = choices_frame(select_methods(calibration, WITH_THE_PAPERS, FEW_DENSITIES))
    evidences = stored_evidence(calibration, choices, FEW_DENSITIES)
    return more_views_rows(objects(3, 2), evidences, SETTINGS, np.random.default_rng(0))


def test_every_view_is_where_it_says_and_counts_its_travel(rows):
    means = rows.groupby(["method", "n_views"])[["error_deg", "travel_deg"]].mean()
    assert means.loc[("bisecting", 4), "travel_deg"] == 180 + 90 + 180
    assert means.loc[("evenly_spaced", 4), "travel_deg"] == 270
    assert means.loc[("evenly_spaced", 3), "travel_deg"] == 240
    assert (means.xs(1, level="n_views")["travel_deg"] == 0).all()
    for method in ("random", "bisecting", "information_gain", "bayes_error"):
        assert means.loc[(method, 4), "error_deg"] < means.loc[(method, 1), "error_deg"]


def test_two_errors_have_two_names_and_the_pose_ambiguity_is_of_two_views_alone(rows):
    """The kernel regression of real errors knows nothing of more views than two."""
    assert set(rows["method"]) == {
        "random",
        "bisecting",
        "evenly_spaced",
        "information_gain",
        "bayes_error",
    }

from __future__ import annotations

import numpy as np
import pytest
from tests.recommendation.made import EXTENSIONS, FEW_DENSITIES, objects

from nbv.calibration.estimates import Estimates
from nbv.experiments.extensions import choices_frame, stored_evidence
from nbv.experiments.view_sphere import sphere_travel_deg, view_sphere_rows
from nbv.recommendation.method_selection import select_methods


def test_great_circles():
    assert sphere_travel_deg(180, 0, 0) == pytest.approx(180)
    assert sphere_travel_deg(0, 0, 60) == pytest.approx(60)
    assert sphere_travel_deg(180, 60, 75) == pytest.approx(45)
    a, b = np.radians([[30, 20], [75, 140]])
    unit = [np.array([np.cos(e) * np.cos(p), np.cos(e) * np.sin(p), np.sin(e)]) for e, p in (a, b)]
    angle = np.degrees(np.arccos(unit[0] @ unit[1]))
    assert sphere_travel_deg(120, 30, 75) == pytest.approx(angle)


def test_the_sphere_goes_where_the_pose_is_seen():
    """At 0 degrees the pose is hidden half the way round; at 30 it is hidden elsewhere."""
    hidden = {0: 90.0, 30: 270.0}
    extensions = EXTENSIONS | {"paper": {"policy": "pose_ambiguity", "fusion": "posterior"}}
    tests, evidences = {}, {}
    for k, (elevation, hidden_deg) in enumerate(hidden.items()):
        estimate_deg = objects(4, 3 + k, hidden_deg).estimate_deg
        tests[elevation] = Estimates(("a", "b", "c", "d"), estimate_deg)
        calibration = objects(6, 5 + k, hidden_deg)
        choices = choices_frame(select_methods(calibration, extensions, FEW_DENSITIES))
        evidences[elevation] = stored_evidence(calibration, choices, FEW_DENSITIES)
    rows = view_sphere_rows(tests, evidences, {"start_every_deg": 60})
    error = rows.groupby(["method", "elevation_deg"])["error_deg"].mean()
    for criterion in ("information_gain", "pose_ambiguity"):
        assert error[f"{criterion}_sphere", 0] < error["opposite", 0]
        circle = rows[rows["method"] == f"{criterion}_circle"]
        assert (circle["next_elevation_deg"] == circle["elevation_deg"]).all()

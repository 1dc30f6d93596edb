from __future__ import annotations

import numpy as np
import pytest
from nbv.experiment.view_sphere import sphere_travel_deg, view_sphere_rows
from studies.extensions import choices_frame, stored_evidence
from tests.core.made import EXTENSIONS, FEW_DENSITIES, objects

from nbv.core.estimates import Estimates
from nbv.core.selection import select_methods


def test_great_circles():
    assert sphere_travel_deg(180, 0, 0) == pytest.approx(180)
    assert sphere_travel_deg(0, 0, 60) == pytest.approx(60)
    assert sphere_travel_deg(180, 60, 75) == pytest.approx(45)
    a, b = np.radians([[30, 20], [75, 140]])
    unit = [np.array([np.cos(e) * np.cos(p), np.cos(e) * np.sin(p), np.sin(e)]) for e, p in (a, b)]
    angle = np.degrees(np.arccos(unit[0] @ unit[1]))
    assert sphere_travel_deg(120, 30, 75) == pytest.approx(angle)


@pytest.fixture(scope="module")
def made():
    """Two elevations: at 0 degrees the pose is hidden half the way round, at 30 elsewhere."""
    extensions = EXTENSIONS | {"paper": {"policy": "pose_ambiguity", "fusion": "posterior"}}
    tests, evidences = {}, {}
    for k, (elevation, hidden_deg) in enumerate({0: 0.0, 30: 180.0}.items()):
        estimate_deg = objects(4, 3 + k, hidden_deg).estimate_deg
        tests[elevation] = Estimates(("a", "b", "c", "d"), estimate_deg)
        calibration = objects(6, 5 + k, hidden_deg)
        choices = choices_frame(select_methods(calibration, extensions, FEW_DENSITIES))
        evidences[elevation] = stored_evidence(calibration, choices, FEW_DENSITIES)
    return tests, evidences


def test_the_sphere_goes_where_the_pose_is_seen(made):
    rows = view_sphere_rows(*made, {"start_every_deg": 60})
    error = rows.groupby(["method", "elevation_deg"])["error_deg"].mean()
    for criterion in ("information_gain", "pose_ambiguity"):
        assert error[f"{criterion}_sphere", 0] < error["opposite", 0]
        circle = rows[rows["method"] == f"{criterion}_circle"]
        assert (circle["next_elevation_deg"] == circle["elevation_deg"]).all()


def ambiguity(belief, first, second):
    """Eqs. 1, 3 and 6 for every rotation, one T for each view."""
    cost = []
    for k in range(len(belief)):
        product = first * np.roll(second, (-k, -k), axis=(0, 1))
        pose = (belief / product.sum(axis=1)) @ product
        cost.append(-(pose * np.log(pose)).sum())
    return np.array(cost)


def test_each_view_has_the_factor_of_its_own_elevation(made):
    tests, evidences = made
    T = {e: evidences[e]["pose_ambiguity"](120).conditionals.viewpoint for e in tests}
    rows = view_sphere_rows(tests, evidences, {"start_every_deg": 360})
    rows = rows[rows["method"] == "pose_ambiguity_sphere"].set_index(["elevation_deg", "object_id"])
    rotations = np.arange(120) * 3.0
    told_apart = 0
    for e, test in tests.items():
        V = evidences[e]["pose_ambiguity"](360).conditionals.viewpoint
        for object_id, estimate in zip(test.object_ids, test.estimate_deg[:, 0], strict=True):
            belief = np.roll(V[round(estimate) % 360], 1).reshape(120, 3).sum(axis=1)
            own = {o: ambiguity(belief, T[e], T[o]) for o in tests}
            row = rows.loc[e, object_id]
            chosen = int(row["next_elevation_deg"])
            same = np.isclose(sphere_travel_deg(rotations, e, chosen), row["travel_deg"])
            least = min(cost.min() for cost in own.values())
            assert own[chosen][same].min() < least + 1e-4
            wrong = {o: ambiguity(belief, T[o], T[o]) for o in tests}
            misled = min(wrong, key=lambda o: wrong[o].min())
            told_apart += own[misled][wrong[misled].argmin()] > least + 1e-3
    assert told_apart > 0

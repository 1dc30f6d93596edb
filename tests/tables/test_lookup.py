"""Answers of lookup tables: which of them have errors, and a decision."""

import numpy as np
import pytest

import nbv
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.criteria import CRITERIA, FOR_A_FUSION

AZIMUTHS = np.arange(360.0)
DENSITY = {"pose_likelihood": "given_estimate", "spread": "entropy"}


def table(criterion: str, error_deg: np.ndarray) -> nbv.LookupTable:
    estimates = (AZIMUTHS + error_deg) % 360
    evidence = nbv.gather_evidence(estimates, DENSITY, bandwidth_deg=8, pseudo_observations=3)
    return nbv.build_lookup(evidence, criterion)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_costs_that_calibration_objects_had_are_compared_with_the_error_of_one_view(criterion):
    error_deg = np.random.default_rng(0).normal(0, 8, (5, 360))
    answer = table(criterion, error_deg).rank(200.4)
    if criterion not in FOR_A_FUSION:
        assert answer.decision.verdict is None
        assert np.isnan(answer.expected_error_deg)
        return
    apart = circular_distance_deg(AZIMUTHS + error_deg, 200.0)
    # With the 3 pseudo-observations of the mean over all views.
    kernel = np.exp((np.cos(np.radians(apart)) - 1) / np.radians(8.0) ** 2)
    kernel /= np.exp((np.cos(np.radians(AZIMUTHS)) - 1) / np.radians(8.0) ** 2).sum()
    mean = np.abs(error_deg).mean()
    wanted = ((kernel * np.abs(error_deg)).sum() + 3 * mean) / (kernel.sum() + 3)
    wanted = mean if criterion == "fixed" else wanted
    assert answer.expected_error_deg == pytest.approx(wanted, rel=1e-3)
    assert answer.decision.verdict == "one more view"
    assert answer.decide(until_deg=wanted + 0.01).verdict == "enough"


def test_no_view_helps_where_errors_are_the_same_from_everywhere():
    turned = np.array([[0.0], [40.0]]) + np.zeros(360)
    assert table("expected_error", turned).rank(90.0).decision.verdict == "no view helps"

"""One rotation for every estimate: the best on calibration objects."""

from __future__ import annotations

import numpy as np

from nbv.recommendation.belief import Belief
from nbv.recommendation.criteria.expected_error import first_estimate_bins
from nbv.recommendation.evidence import Evidence, Table
from nbv.recommendation.fusion import calibration_errors_deg


def fixed(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the mean error of each rotation over all calibration views, the same in every row.

    What `nbv.recommendation.criteria.expected_error.expected_error` tends to with ever more
    pseudo-observations; parameters, errors and unit as there.
    """
    errors = calibration_errors_deg(evidence, fusion)
    mean = errors.reshape(evidence.n_bins, -1).mean(axis=1)
    return np.tile(mean, (len(first_estimate_bins(belief, evidence)), 1)).astype(np.float32)

"""One rotation for every first view: the best on calibration objects."""

from __future__ import annotations

import numpy as np

from nbv.core.belief import Belief
from nbv.core.criteria.expected_error import need_first_view
from nbv.core.evidence import Evidence, Table
from nbv.core.fusion import calibration_errors_deg


def fixed(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the mean error of each rotation over all calibration views, the same in every row.

    What `nbv.core.criteria.expected_error.expected_error` tends to with ever more
    pseudo-observations; parameters, errors and unit as there.
    """
    need_first_view(belief, evidence)
    errors = calibration_errors_deg(evidence, fusion)
    mean = errors.reshape(evidence.n_bins, -1).mean(axis=1)
    return np.tile(mean, (len(belief.probabilities), 1)).astype(np.float32)

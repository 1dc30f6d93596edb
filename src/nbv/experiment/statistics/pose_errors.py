"""What the error of one image adds to each figure of merit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

PAUC_LIMIT_DEG = 100.0
"""Upper end of the thresholds that the pAUC integrates over (Tables 3 and 4 of the paper)."""

HALF_TURN_DEG = 90.0
"""An error above it has front and back confused rather than being inaccurate."""


def accuracy_area(errors_deg: ArrayLike) -> Floats:
    """Return what each image adds to the mean that is the pAUC, in percent, in [0, 100]."""
    return PAUC_LIMIT_DEG - np.minimum(np.asarray(errors_deg, dtype=np.float64), PAUC_LIMIT_DEG)


def half_turned(errors_deg: ArrayLike) -> Floats:
    """Return what each image adds to the share of errors above 90°, in percent: 0 or 100."""
    return np.where(np.asarray(errors_deg, dtype=np.float64) > HALF_TURN_DEG, 100.0, 0.0)

"""A second view from every test image: one row of results for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.angles import circular_distance_deg
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence
from nbv.core.lookup import LookupTable
from nbv.core.policies import Turns, two_views

COLUMNS = (
    "object_id",
    "initial_deg",
    "initial_estimate_deg",
    "delta_deg",
    "next_estimate_deg",
    "pose_estimate_deg",
    "error_deg",
)


def evaluate_method(
    method: Mapping[str, Any],
    test: Estimates,
    rng: np.random.Generator | None = None,
    lookup: LookupTable | None = None,
    evidence: Evidence | None = None,
    posteriors: Posteriors | None = None,
) -> pd.DataFrame:
    """Evaluate one method on every view of every test object.

    Parameters
    ----------
    method : mapping
        ``policy`` and ``fusion``; see `nbv.core.policies.two_views`.
    test : Estimates
        360 / n_views must be a whole number of degrees.
    rng, lookup, evidence : optional
        What the policy or the fusion needs; see `nbv.core.policies.Turns`.
    posteriors : Posteriors, optional
        Of the test objects, where the fusion is of distributions.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`; ``delta_deg`` and ``next_estimate_deg`` are absent for ``none``.
    """
    distributions = None if posteriors is None else posteriors.distributions
    turns = Turns(test.estimate_deg, evidence, rng, lookup, distributions)
    made = two_views(method["policy"], method["fusion"], turns)
    n_objects, n_views = test.estimate_deg.shape
    # Rounded before the error is taken, so that the columns of a row agree with each other.
    pose = np.round(made.pose_deg, 4) % 360.0
    return pd.DataFrame(
        {
            "object_id": np.repeat(np.asarray(test.object_ids, dtype=object), n_views),
            "initial_deg": np.tile(test.azimuth_deg.astype(int), n_objects),
            "initial_estimate_deg": test.estimate_deg.ravel(),
            "delta_deg": pd.array([pd.NA] * (n_objects * n_views), dtype="Int64")
            if made.delta_deg is None
            else made.delta_deg.ravel(),
            "next_estimate_deg": np.nan if made.second_deg is None else made.second_deg.ravel(),
            "pose_estimate_deg": pose.ravel(),
            "error_deg": circular_distance_deg(pose, test.azimuth_deg).ravel(),
        }
    )

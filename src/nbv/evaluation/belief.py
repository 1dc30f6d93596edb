"""Recommending from each image's own distribution: one row of results for every test image."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nbv.calibration.pairs import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.evaluation.methods import results_frame
from nbv.recommendation.belief import fuse_beliefs, worth
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.fusion import second_look
from nbv.recommendation.lookup import LookupTable, least_ambiguous_delta


def evaluate_belief(
    test: Estimates, posteriors: Posteriors, calibration: Estimates, lookup: LookupTable
) -> pd.DataFrame:
    """Recommend by the belief that each image gives, and fuse the beliefs of both images.

    Bins are the classes: what is recommended is a multiple of their width.

    Parameters
    ----------
    test : Estimates
        360 / n_views must be a whole number of degrees, and divide 360 / n_classes.
    posteriors : Posteriors
        Of the same objects.
    calibration : Estimates
        What L is made of, by the density settings of `lookup`.
    lookup : LookupTable

    Returns
    -------
    DataFrame
        Columns `nbv.evaluation.methods.COLUMNS`.
    """
    beliefs = np.exp(posteriors.log_posterior.astype(np.float64))
    n_objects, n_views, n_classes = beliefs.shape
    evidence = gather_evidence(
        calibration.estimate_deg,
        {},
        bandwidth_deg=lookup.bandwidth_deg,
        pseudo_observations=lookup.pseudo_observations,
        n_bins=n_classes,
    )
    flat = beliefs.reshape(-1, n_classes)
    left = worth("information_gain", flat.astype(np.float32), evidence)
    delta = least_ambiguous_delta(left).reshape(n_objects, n_views)
    views = (np.arange(n_views) + delta * n_views // 360) % n_views
    second = np.take_along_axis(beliefs, views[..., None], axis=1).reshape(-1, n_classes)
    pose = fuse_beliefs(flat, second, delta.ravel()).reshape(n_objects, n_views)
    return results_frame(test, delta, second_look(test.estimate_deg, delta), pose)

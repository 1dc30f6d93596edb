"""Choosing and fusing by each image's own distribution: one row of results for every test image."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nbv.calibration.density import Likelihoods
from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors, answer_likelihood
from nbv.experiments.two_views import results_frame
from nbv.recommendation.belief import fuse_beliefs, worth
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.fusion import second_look
from nbv.recommendation.lookup import least_ambiguous_delta

METHODS = ("belief", "belief_opposite")


def evaluate_beliefs(
    test: Estimates, posteriors: Posteriors, calibration: Posteriors
) -> dict[str, pd.DataFrame]:
    """Take a second view, and fuse what the two images say as distributions.

    Bins are the classes: what is recommended is a multiple of their width.

    Parameters
    ----------
    test : Estimates
        n_views is a multiple of the number of classes.
    posteriors : Posteriors
        Of the same objects.
    calibration : Posteriors
        Of calibration objects: how the second look will answer.

    Returns
    -------
    dict of DataFrame
        By `METHODS`, columns `nbv.experiments.two_views.COLUMNS`: the second view that leaves each
        image's belief the least expected entropy, and the opposite one, which tells what is owed to
        the choice from what is owed to fusing distributions.
    """
    beliefs = np.exp(posteriors.log_posterior.astype(np.float64))
    n_objects, n_views, n_classes = beliefs.shape
    first = beliefs.reshape(-1, n_classes)
    left = worth("information_gain", first.astype(np.float32), _evidence(calibration))
    chosen = least_ambiguous_delta(left).reshape(n_objects, n_views)
    frames = {}
    for name, delta in zip(METHODS, (chosen, np.full_like(chosen, 180)), strict=True):
        views = (np.arange(n_views) + delta * n_views // 360) % n_views
        second = np.take_along_axis(beliefs, views[..., None], axis=1).reshape(-1, n_classes)
        pose = fuse_beliefs(first, second, delta.ravel()).reshape(n_objects, n_views)
        frames[name] = results_frame(test, delta, second_look(test.estimate_deg, delta), pose)
    return frames


def _evidence(calibration: Posteriors) -> Evidence:
    """Return how the second look answers as evidence: unsmoothed, for it is smooth already."""
    answers = answer_likelihood(calibration)
    viewpoints = answers.T / answers.sum(axis=0)[:, None]
    return Evidence(np.empty((0, len(answers))), Likelihoods(viewpoints, answers), 0.0, 0.0, {})

"""Estimates of the objects that a fold's estimator has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from nbv.core.estimates import Estimates, Posteriors, posteriors_of
from nbv.core.logits import fit_temperature
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimates import write_estimates, write_posteriors
from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.inference import decode, outputs_of_parts
from nbv.experiment.estimation.weights import Estimator
from nbv.experiment.splits import calibration_roles, need_objects, objects_with_role

FoldEstimates = dict[str, tuple[Estimates, Posteriors | None]]
"""For ``calibration`` and ``test``; without posteriors where outputs are no logits."""


def estimate_fold(
    images: DepthImages,
    splits: pd.DataFrame,
    fold: int,
    tested: Estimator,
    of_parts: Sequence[Estimator],
    hardware: Hardware,
    *,
    distributions: bool,
) -> FoldEstimates:
    """Estimate every view of a fold's calibration and test objects.

    Parameters
    ----------
    images : DepthImages
        All objects of a category.
    splits : DataFrame
        From `nbv.experiment.splits.read_splits`.
    fold : int
    tested : Estimator
        The one that test objects meet.
    of_parts : sequence of Estimator
        Where calibration is cross-fitted: for each part the estimator that has not seen it.
    hardware : Hardware
    distributions : bool
        Whether outputs are logits of distributions. Calibration objects then choose one
        temperature (`nbv.core.logits.fit_temperature`).

    Returns
    -------
    FoldEstimates

    Raises
    ------
    UserError
        As of `nbv.experiment.splits.need_objects` and
        `nbv.experiment.estimation.inference.outputs_of_parts`.
    """
    need_objects(splits, images.object_ids)
    parts = [objects_with_role(splits, fold, role) for role in calibration_roles(splits)]
    test = [objects_with_role(splits, fold, "test")]
    outputs = {
        "calibration": outputs_of_parts(of_parts or [tested], images, parts, hardware),
        "test": outputs_of_parts([tested], images, test, hardware),
    }
    temperature, posteriors = 1.0, None
    if distributions:
        azimuth_deg = np.linspace(0, 360, images.codes.shape[1], endpoint=False)
        temperature = fit_temperature(outputs["calibration"][1], azimuth_deg)
    found = {}
    for role, (object_ids, output) in outputs.items():
        if distributions:
            posteriors = posteriors_of(object_ids, output, temperature)
        found[role] = Estimates(tuple(object_ids), decode(tested, output, temperature)), posteriors
    return found


def write_fold(paths: Mapping[str, str], found: FoldEstimates) -> None:
    """Write a fold's estimates.

    Parameters
    ----------
    paths : mapping
        The files of ``calibration`` and ``test``, and where there are posteriors those of
        ``calibration_posteriors`` and ``test_posteriors``.
    found : FoldEstimates
    """
    for role, (estimates, posteriors) in found.items():
        write_estimates(paths[role], estimates)
        if posteriors is not None:
            write_posteriors(paths[f"{role}_posteriors"], posteriors)

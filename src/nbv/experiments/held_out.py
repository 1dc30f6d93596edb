"""Estimates of the objects that a fold's estimator has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.calibration.posteriors import fit_temperature
from nbv.calibration.splits import calibration_roles, objects_with_role
from nbv.estimation.hardware import Hardware
from nbv.estimation.inference import decode, outputs_of_parts
from nbv.estimation.weights import Estimator


@dataclass(frozen=True)
class Answers:
    """What an estimator says of every view of some objects.

    Attributes
    ----------
    object_ids : tuple of str
        n objects.
    estimate_deg : ndarray (n, n_views) float64
        In [0, 360).
    outputs : ndarray (n, n_views, k) float64
        The network's outputs.
    temperature : float or None
        What a classifier's outputs are divided by; None where there are no distributions.
    """

    object_ids: tuple[str, ...]
    estimate_deg: NDArray[np.float64]
    outputs: NDArray[np.float64]
    temperature: float | None


def estimate_fold(
    depth: NDArray[np.uint8],
    splits: pd.DataFrame,
    fold: int,
    tested: Estimator,
    of_parts: Sequence[Estimator],
    hardware: Hardware,
    *,
    distributions: bool,
) -> dict[str, Answers]:
    """Estimate every view of a fold's calibration and test objects.

    Parameters
    ----------
    depth : ndarray (n_objects, n_views, side, side) uint8
        All objects of a category, in the order of the splits.
    splits : DataFrame
        From `nbv.calibration.splits.read_splits`.
    fold : int
    tested : Estimator
        The one that test objects meet.
    of_parts : sequence of Estimator
        Where calibration is cross-fitted: for each part the estimator that has not seen it.
    hardware : Hardware
    distributions : bool
        Whether outputs are logits of distributions. Calibration objects then choose one
        temperature (`nbv.calibration.posteriors.fit_temperature`).

    Returns
    -------
    dict of str to Answers
        For ``calibration`` and ``test``.

    Raises
    ------
    UserError
        Where an estimator has seen one of its objects, or images of another size.
    """
    parts = [objects_with_role(splits, fold, role) for role in calibration_roles(splits)]
    test = [objects_with_role(splits, fold, "test")]
    outputs = {
        "calibration": outputs_of_parts(of_parts or [tested], depth, parts, hardware),
        "test": outputs_of_parts([tested], depth, test, hardware),
    }
    temperature = None
    if distributions:
        azimuth_deg = np.linspace(0, 360, depth.shape[1], endpoint=False)
        temperature = fit_temperature(outputs["calibration"][1], azimuth_deg)
    return {
        role: Answers(
            tuple(object_ids), decode(tested, output, temperature or 1.0), output, temperature
        )
        for role, (object_ids, output) in outputs.items()
    }

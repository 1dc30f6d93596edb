"""Estimating azimuths with a trained network."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from nbv.angles import direction_deg
from nbv.errors import UserError
from nbv.estimation.hardware import Hardware
from nbv.estimation.images import to_input
from nbv.estimation.weights import Estimator


def estimate_objects(
    estimator: Estimator,
    depth: NDArray[np.uint8],
    rows: NDArray[np.intp],
    object_ids: Sequence[str],
    hardware: Hardware,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate every view of some objects of a depth file, none of which was trained on.

    Parameters
    ----------
    estimator : Estimator
    depth : ndarray (n_objects, n_views, side, side) uint8
        All objects of a category.
    rows, object_ids
        Which of them to estimate, and their names.
    hardware : Hardware

    Returns
    -------
    estimate_deg, concentration : ndarray (n, n_views) float64

    Raises
    ------
    UserError
        Where the estimator has seen one of the objects, or images of another size.
    """
    seen = sorted(set(object_ids) & set(estimator.trained_on))
    if seen:
        raise UserError(
            f"object {seen[0]!r} was trained on: its estimates say nothing; train again"
        )
    if depth.shape[-1] != estimator.image_side:
        raise UserError(
            f"the images have {depth.shape[-1]} pixels a side, the estimator was trained on "
            f"{estimator.image_side}; train again"
        )
    return estimate_azimuth(estimator.network, depth[rows], hardware)


def estimate_azimuth(
    network: nn.Module,
    codes: NDArray[np.uint8],
    hardware: Hardware,
    batch_size: int = 1024,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate the azimuth that each image was taken from (Eq. 4).

    Parameters
    ----------
    network : torch.nn.Module
        A regressor, in evaluation mode.
    codes : ndarray (..., side, side) uint8
        Depth codes.
    hardware : Hardware
    batch_size : int

    Returns
    -------
    estimate_deg : ndarray (...) float64
        In [0, 360).
    concentration : ndarray (...) float64
        The length of the (cos, sin) output.
    """
    side = codes.shape[-1]
    flat = codes.reshape(-1, side, side)
    outputs = []
    with torch.inference_mode(), hardware.autocast():
        for start in range(0, len(flat), batch_size):
            output = network(to_input(flat[start : start + batch_size], hardware))
            outputs.append(output.float().cpu().numpy().astype(np.float64))
    vectors = np.concatenate(outputs).reshape(*codes.shape[:-2], 2)
    cosine, sine = vectors[..., 0], vectors[..., 1]
    return direction_deg(cosine, sine), np.hypot(cosine, sine)

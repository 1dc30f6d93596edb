"""Outputs of trained networks, and the estimates of a fold's held-out objects from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from nbv.data.depth_images import DepthImages
from nbv.errors import UserError
from nbv.experiment.estimates import FoldEstimates
from nbv.experiment.estimation.hardware import Hardware, to_input
from nbv.experiment.estimation.outputs import Outputs, estimates_of, mirrored_outputs
from nbv.experiment.estimation.weights import Estimator
from nbv.experiment.splits import calibration_roles, check_objects, objects_with_role

INFERENCE_BATCH = 256
"""Images per batch of inference: larger batches take longer and more memory."""


def outputs_of_parts(
    estimators: Sequence[Estimator],
    images: DepthImages,
    parts: Sequence[Sequence[str]],
    hardware: Hardware,
) -> tuple[list[str], Outputs]:
    """Return the ids of n objects, divided in parts among estimators, and outputs (n, n_views, k).

    Raises
    ------
    UserError
        Where an estimator was trained on one of its objects, or on images of another size, or its
        outputs are not finite.
    """
    names: list[str] = []
    outputs = []
    for estimator, object_ids in zip(estimators, parts, strict=True):
        if seen := sorted(set(object_ids) & set(estimator.trained_on)):
            raise UserError(
                f"object {seen[0]!r} is a training object of its estimator; train again"
            )
        names += object_ids
        outputs.append(network_outputs(estimator, images.of(object_ids), hardware))
    return names, np.concatenate(outputs)


def network_outputs(
    estimator: Estimator,
    codes: NDArray[np.uint8],
    hardware: Hardware,
    batch_size: int = INFERENCE_BATCH,
) -> Outputs:
    """Return the network's outputs (..., k) for depth codes (..., side, side).

    Where the estimator was trained on mirror images, they are the mean of those for an image and
    for its mirror image.

    Raises
    ------
    UserError
        Where the estimator was trained on images of another size, or its outputs are not finite.
    """
    side = codes.shape[-1]
    if side != estimator.image_side:
        raise UserError(
            f"the images have {side} pixels a side, the estimator was trained on "
            f"{estimator.image_side}; train again"
        )
    flat = codes.reshape(-1, side, side)
    outputs = []
    for start in range(0, len(flat), batch_size):
        batch = flat[start : start + batch_size]
        output = _forward(estimator, batch, hardware)
        if (plane_deg := estimator.mirror_plane_deg) is not None:
            mirrored = _forward(estimator, batch[..., ::-1], hardware)
            output = (output + mirrored_outputs(mirrored, plane_deg)) / 2
        outputs.append(output)
    joined = np.concatenate(outputs).reshape(*codes.shape[:-2], -1)
    if not np.isfinite(joined).all():
        raise UserError("the estimator's outputs are not finite; train it again")
    return joined


def _forward(estimator: Estimator, codes: NDArray[np.uint8], hardware: Hardware) -> Outputs:
    with torch.inference_mode(), hardware.autocast():
        output = estimator.network(to_input(codes, hardware))
    return np.asarray(output.float().cpu().numpy(), dtype=np.float64)


def estimate_fold(
    images: DepthImages,
    splits: pd.DataFrame,
    fold: int,
    tested: Estimator,
    part_estimators: Sequence[Estimator],
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
    tested : Estimator
        The estimator of test objects.
    part_estimators : sequence of Estimator
        For cross-fitted calibration: the estimators that have not seen each part.
    distributions : bool
        See `nbv.experiment.estimation.outputs.estimates_of`.

    Raises
    ------
    UserError
        Where the objects differ from those in the splits, or as `outputs_of_parts` raises.
    """
    check_objects(splits, images.object_ids)
    parts = [objects_with_role(splits, fold, role) for role in calibration_roles(splits)]
    test = [objects_with_role(splits, fold, "test")]
    outputs = {
        "calibration": outputs_of_parts(part_estimators or [tested], images, parts, hardware),
        "test": outputs_of_parts([tested], images, test, hardware),
    }
    return estimates_of(outputs, distributions=distributions)

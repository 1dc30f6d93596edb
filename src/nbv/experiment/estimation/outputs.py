"""Outputs of estimators: the targets they are trained on, and the azimuths they stand for.

An estimator of azimuths has the outputs (cos, sin), one of distributions a logit for each class.
View k of n has the azimuth 360 k / n.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import direction_deg, mirrored_bins
from nbv.core.circle.estimates import Estimates, posteriors_of
from nbv.core.circle.logits import fit_temperature, softmax
from nbv.experiment.estimates import FoldEstimates

Settings = Mapping[str, Any]
Targets = NDArray[np.float32]
Outputs = NDArray[np.float64]


def direction_targets(settings: Settings, n_views: int) -> Targets:
    """Return (cos, sin) of the azimuth of every view, (n_views, 2)."""
    angles = 2 * np.pi * np.arange(n_views) / n_views
    return np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)


def class_targets(settings: Settings, n_views: int) -> Targets:
    """Return a distribution over classes for every view, (n_views, n_classes), rows summing to 1.

    Class c of k is centred on 360 c / k degrees. The target is a von Mises density about the
    azimuth instead of a single class, so that nearby classes are nearly right and the circle has
    no seam. ``target_bandwidth_deg`` is the standard deviation of a narrow target.
    """
    n_classes = settings["n_classes"]
    centres = 2 * np.pi * np.arange(n_classes) / n_classes
    apart = centres - 2 * np.pi * np.arange(n_views)[:, None] / n_views
    narrowness = 1.0 / np.radians(settings["target_bandwidth_deg"]) ** 2
    return np.asarray(softmax(narrowness * (np.cos(apart) - 1.0)), dtype=np.float32)


def mirrored_outputs(outputs: Outputs, plane_deg: float) -> Outputs:
    """Return outputs (..., k) for mirror images as outputs for the images themselves.

    `plane_deg` is the azimuth m of the objects' plane of symmetry: a mirror image of the azimuth
    2 m - a stands for a.
    """
    if outputs.shape[-1] > 2:
        return outputs[..., mirrored_bins(outputs.shape[-1], plane_deg)]
    cos, sin = np.cos(np.radians(2 * plane_deg)), np.sin(np.radians(2 * plane_deg))
    return np.asarray(outputs @ np.array([[cos, sin], [sin, -cos]]))


def decode_directions(outputs: Outputs) -> Outputs:
    """Return the direction of (cos, sin) outputs (..., 2), degrees in [0, 360) (Eq. 4)."""
    return direction_deg(outputs[..., 0], outputs[..., 1])


def decode_classes(outputs: Outputs) -> Outputs:
    """Return the mean direction of the softmax of logits (..., k), degrees in [0, 360).

    It is the direction of the mean of exp(i theta), which minimises the expected 1 - cos(error).
    """
    n_classes = outputs.shape[-1]
    angles = 2 * np.pi * np.arange(n_classes) / n_classes
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return decode_directions(softmax(outputs) @ unit)


def estimates_of(
    outputs: Mapping[str, tuple[Sequence[str], Outputs]], *, distributions: bool
) -> FoldEstimates:
    """Return the estimates of a fold's held-out objects.

    Parameters
    ----------
    outputs : mapping
        For each role, ``calibration`` and ``test``, the ids of n objects and the outputs
        (n, n_views, k) for their sweeps.
    distributions : bool
        Whether outputs are logits of distributions. Calibration objects then choose one
        temperature (`nbv.core.circle.logits.fit_temperature`).
    """
    if not distributions:
        return {
            role: (Estimates(tuple(object_ids), decode_directions(output)), None)
            for role, (object_ids, output) in outputs.items()
        }
    _, calibration = outputs["calibration"]
    azimuth_deg = np.linspace(0, 360, calibration.shape[1], endpoint=False)
    temperature = fit_temperature(calibration, azimuth_deg)
    return {
        role: (
            Estimates(tuple(object_ids), decode_classes(output / temperature)),
            posteriors_of(object_ids, output, temperature),
        )
        for role, (object_ids, output) in outputs.items()
    }

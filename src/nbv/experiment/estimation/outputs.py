"""What the outputs of a network mean: what they are trained towards, and the angle they tell.

View k of n has the azimuth 360 k / n.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import direction_deg

Settings = Mapping[str, Any]
Targets = NDArray[np.float32]
Outputs = NDArray[np.float64]


def direction_targets(settings: Settings, n_views: int) -> Targets:
    """Return (cos, sin) of the azimuth of every view, (n_views, 2)."""
    angles = 2 * np.pi * np.arange(n_views) / n_views
    return np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)


def class_targets(settings: Settings, n_views: int) -> Targets:
    """Return a distribution over classes for every view, (n_views, n_classes), rows summing to 1.

    Class c of k is centred on 360 c / k degrees. Instead of all its mass on the class that holds
    the azimuth, a view's target is a von Mises density about the azimuth itself, so that nearby
    classes are nearly right and nothing ends at 0°.

    Parameters
    ----------
    settings : mapping
        ``n_classes`` and ``target_bandwidth_deg``, the standard deviation of a narrow target.
    n_views : int
    """
    n_classes = settings["n_classes"]
    centres = 2 * np.pi * np.arange(n_classes) / n_classes
    apart = centres - 2 * np.pi * np.arange(n_views)[:, None] / n_views
    narrowness = 1.0 / np.radians(settings["target_bandwidth_deg"]) ** 2
    return np.asarray(_softmax(narrowness * (np.cos(apart) - 1.0), axis=1), dtype=np.float32)


def decode_directions(outputs: Outputs) -> Outputs:
    """Return the direction of (cos, sin) outputs (..., 2), degrees in [0, 360)."""
    return direction_deg(outputs[..., 0], outputs[..., 1])


def decode_classes(outputs: Outputs) -> Outputs:
    """Return the mean direction of the softmax of logits (..., k), degrees in [0, 360).

    It is the direction of the mean of exp(i theta): the estimate of least expected 1 - cos(error).
    """
    n_classes = outputs.shape[-1]
    angles = 2 * np.pi * np.arange(n_classes) / n_classes
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return decode_directions(_softmax(outputs, axis=-1) @ unit)


def _softmax(logits: Outputs, axis: int) -> Outputs:
    # Loading it takes a tenth of a second, for which no regressor's job should wait.
    from scipy.special import softmax

    return np.asarray(softmax(logits, axis=axis))

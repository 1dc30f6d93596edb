"""The kinds of estimators: networks, training targets and the decoding of outputs to angles.

A network maps images (n, 1, side, side) to outputs (n, k). View k of n has the azimuth 360 k / n.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from nbv.core.angles import direction_deg
from nbv.core.logits import softmax
from nbv.errors import UserError, nearest

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
    no seam.

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
    return np.asarray(softmax(narrowness * (np.cos(apart) - 1.0)), dtype=np.float32)


def decode_directions(outputs: Outputs) -> Outputs:
    """Return the direction of (cos, sin) outputs (..., 2), degrees in [0, 360)."""
    return direction_deg(outputs[..., 0], outputs[..., 1])


def decode_classes(outputs: Outputs) -> Outputs:
    """Return the mean direction of the softmax of logits (..., k), degrees in [0, 360).

    It is the direction of the mean of exp(i theta), which minimises the expected 1 - cos(error).
    """
    n_classes = outputs.shape[-1]
    angles = 2 * np.pi * np.arange(n_classes) / n_classes
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return decode_directions(softmax(outputs) @ unit)


def _strided_network(settings: Settings, image_side: int, n_outputs: int) -> nn.Module:
    channels = settings["channels"]
    # The first layer's maps are the largest: normalising them took a sixth of the training time and
    # did not improve estimates.
    layers = [nn.Conv2d(1, channels[0], 5, stride=2, padding=2), nn.ReLU(inplace=True)]
    for before, after in pairwise(channels):
        layers += [
            nn.Conv2d(before, after, 3, stride=2, padding=1, bias=False),
            nn.BatchNorm2d(after),
            nn.ReLU(inplace=True),
        ]
    side = image_side
    for _ in channels:
        side = (side + 1) // 2
    return nn.Sequential(
        nn.Sequential(*layers),
        nn.Flatten(),
        nn.Linear(channels[-1] * side * side, settings["hidden"]),
        nn.ReLU(inplace=True),
        nn.Linear(settings["hidden"], n_outputs),
    )


def regressor(settings: Settings, image_side: int) -> nn.Module:
    """Return a network in the spirit of Pose-CyclicR-Net with the outputs (cos, sin).

    Strided convolutions, with batch normalisation from the second on, one hidden layer, two linear
    outputs (paper, Sec. 3.2.1). The outputs are not normalised: trained on squared error they tend
    to the mean direction, whose length measures the network's certainty.

    Parameters
    ----------
    settings : mapping
        ``channels`` (list of int) and ``hidden`` (int).
    image_side : int
        Pixels.
    """
    return _strided_network(settings, image_side, 2)


def classifier(settings: Settings, image_side: int) -> nn.Module:
    """Return the regressor's network with one logit for each of ``n_classes`` azimuths."""
    return _strided_network(settings, image_side, settings["n_classes"])


@dataclass(frozen=True)
class Kind:
    """A kind of estimator.

    Attributes
    ----------
    network : callable
        ``network(settings, image_side)``, untrained.
    targets : callable
        ``targets(settings, n_views)``: the targets of the views of a full turn, (n_views, k).
    loss : callable
        ``loss(outputs, targets)``, a scalar tensor.
    decode : callable
        ``decode(outputs)``: the angles of outputs (..., k), degrees in [0, 360).
    """

    network: Callable[[Settings, int], nn.Module]
    targets: Callable[[Settings, int], Targets]
    loss: Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
    decode: Callable[[Outputs], Outputs]


KINDS: dict[str, Kind] = {
    "regressor": Kind(regressor, direction_targets, nn.functional.mse_loss, decode_directions),
    "classifier": Kind(classifier, class_targets, nn.functional.cross_entropy, decode_classes),
}


def kind_of(settings: Settings) -> Kind:
    """Return the kind that ``settings["kind"]`` names.

    Raises
    ------
    UserError
        For an unknown kind.
    """
    name = settings["kind"]
    if name not in KINDS:
        raise UserError(f"estimator.kind={name}: {nearest(name, KINDS)}")
    return KINDS[name]


def build_network(settings: Settings, image_side: int) -> nn.Module:
    """Return an untrained network of the kind that `kind_of` finds.

    Its weights come from torch's global generator; seed that first.
    """
    network = kind_of(settings).network(settings, image_side)
    # torch's annotations lack this form of `to`, which works in place.
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return network

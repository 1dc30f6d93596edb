"""The kinds of networks, each with the targets and the loss of its training.

A network maps images (n, 1, side, side) to outputs (n, k).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import nn

from nbv.experiment.estimation.outputs import (
    Settings,
    Targets,
    class_targets,
    direction_targets,
)


def strided_network(settings: Settings, image_side: int, n_outputs: int) -> nn.Module:
    """Return a network in the spirit of Pose-CyclicR-Net (paper, Sec. 3.2.1).

    Strided convolutions, with batch normalisation from the second on, one hidden layer and linear
    outputs. The outputs (cos, sin) of a regressor are not normalised: trained on squared error they
    tend to the mean direction, whose length measures the network's certainty. The settings are
    ``channels`` (list of int) and ``hidden`` (int); `image_side` is in pixels.
    """
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


Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Kind:
    """A kind of estimator.

    ``network(settings, image_side, k)`` returns an untrained network, ``targets(settings,
    n_views)`` those of the views of a sweep, (n_views, k), and ``loss(outputs, targets)`` a scalar
    tensor.
    """

    network: Callable[[Settings, int, int], nn.Module]
    targets: Callable[[Settings, int], Targets]
    loss: Loss


KINDS: dict[str, Kind] = {
    "regressor": Kind(strided_network, direction_targets, nn.functional.mse_loss),
    "classifier": Kind(strided_network, class_targets, nn.functional.cross_entropy),
}


def build_network(settings: Settings, image_side: int) -> nn.Module:
    """Return an untrained network of the kind that ``settings["kind"]`` names.

    Its weights come from torch's global generator; seed that first.
    """
    kind = KINDS[settings["kind"]]
    n_outputs = kind.targets(settings, 1).shape[1]
    network = kind.network(settings, image_side, n_outputs)
    # torch's annotations lack this form of `to`, which works in place.
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return network

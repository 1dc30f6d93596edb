"""The kinds of networks, each with the targets and the loss of its training.

A network maps images (n, 1, side, side) to outputs (n, k).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import nn

from nbv.errors import UserError, nearest
from nbv.experiment.estimation.outputs import (
    Settings,
    Targets,
    class_targets,
    direction_targets,
)


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


Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Kind:
    """A kind of estimator.

    Attributes
    ----------
    network : callable
        ``network(settings, image_side)``, untrained.
    targets : callable
        ``targets(settings, n_views)``: the targets of the views of a sweep, (n_views, k).
    loss : callable
        ``loss(outputs, targets)``, a scalar tensor.
    """

    network: Callable[[Settings, int], nn.Module]
    targets: Callable[[Settings, int], Targets]
    loss: Loss


KINDS: dict[str, Kind] = {
    "regressor": Kind(regressor, direction_targets, nn.functional.mse_loss),
    "classifier": Kind(classifier, class_targets, nn.functional.cross_entropy),
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

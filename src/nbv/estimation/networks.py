"""The networks. A network maps images (n, 1, side, side) to outputs (n, k)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import nn

from nbv.errors import UserError, nearest


def _strided_trunk(channels: list[int]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in zip([1, *channels], channels, strict=False):
        kernel = 5 if before == 1 else 3
        layers += [
            nn.Conv2d(before, after, kernel, stride=2, padding=kernel // 2, bias=False),
            nn.BatchNorm2d(after),
            nn.ReLU(inplace=True),
        ]
    return nn.Sequential(*layers)


def regressor(settings: Mapping[str, Any], image_side: int) -> nn.Module:
    """Return a network in the spirit of Pose-CyclicR-Net with the outputs (cos, sin).

    Strided convolutions with batch normalisation, one hidden layer, two linear outputs (paper,
    Sec. 3.2.1). The outputs are not normalised: trained on squared error they tend to the mean
    direction, whose length says how sure the network is.

    Parameters
    ----------
    settings : mapping
        ``channels`` (list of int) and ``hidden`` (int).
    image_side : int
        Pixels.
    """
    channels = list(settings["channels"])
    side = image_side
    for _ in channels:
        side = (side + 1) // 2
    return nn.Sequential(
        _strided_trunk(channels),
        nn.Flatten(),
        nn.Linear(channels[-1] * side * side, settings["hidden"]),
        nn.ReLU(inplace=True),
        nn.Linear(settings["hidden"], 2),
    )


NETWORKS: dict[str, Callable[[Mapping[str, Any], int], nn.Module]] = {"regressor": regressor}


def build_network(settings: Mapping[str, Any], image_side: int) -> nn.Module:
    """Return an untrained network of the kind that ``settings["kind"]`` names.

    Its weights come from torch's global generator; seed that first.

    Raises
    ------
    UserError
        For an unknown kind.
    """
    kind = settings["kind"]
    if kind not in NETWORKS:
        raise UserError(f"estimator.kind={kind}: {nearest(kind, NETWORKS)}")
    network = NETWORKS[kind](settings, image_side)
    # torch's annotations lack this form of `to`, which works in place.
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return network

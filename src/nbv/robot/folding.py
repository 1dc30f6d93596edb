"""A trained network's weights: their shapes, and convolutions with what is done around them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = NDArray[np.float32]

# torch.nn.BatchNorm2d's default.
_EPSILON = 1e-5


def folded_convolutions(
    weights: Mapping[str, Weights], n_layers: int
) -> list[tuple[Weights, Weights]]:
    """Return kernel and bias of every convolution of `nbv.experiment.estimation.networks`, for depth codes.

    Codes are divided by 128, as `nbv.experiment.estimation.hardware.to_input` does, in the first kernel. Batch
    normalisation is folded into the convolution before it.

    Parameters
    ----------
    weights : mapping
        By their names in the network's state.
    n_layers : int
        How many convolutions there are.
    """
    found = [(weights["0.0.weight"] / np.float32(128), weights["0.0.bias"])]
    for layer in range(1, n_layers):
        kernel = weights[f"0.{3 * layer - 1}.weight"]
        norm = f"0.{3 * layer}."
        scale = weights[norm + "weight"] / np.sqrt(weights[norm + "running_var"] + _EPSILON)
        offset = weights[norm + "bias"] - scale * weights[norm + "running_mean"]
        found.append((kernel * scale[:, None, None, None], offset))
    return [(np.asarray(k, np.float32), np.asarray(b, np.float32)) for k, b in found]


def network_shapes(settings: Mapping[str, Any], image_side: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a classifier's weights (`nbv.experiment.estimation.networks`), by their names.

    Parameters
    ----------
    settings : mapping
        ``channels``, ``hidden`` and ``n_classes``.
    image_side : int
        Pixels.
    """
    channels, hidden, n_classes = (settings[key] for key in ("channels", "hidden", "n_classes"))
    shapes: dict[str, tuple[int, ...]] = {
        "0.0.weight": (channels[0], 1, 5, 5),
        "0.0.bias": (channels[0],),
    }
    for layer, (before, after) in enumerate(pairwise(channels), start=1):
        shapes[f"0.{3 * layer - 1}.weight"] = (after, before, 3, 3)
        for name in ("weight", "bias", "running_mean", "running_var"):
            shapes[f"0.{3 * layer}.{name}"] = (after,)
    side = image_side
    for _ in channels:
        side = (side + 1) // 2
    shapes["2.weight"] = (hidden, channels[-1] * side**2)
    shapes["4.weight"] = (n_classes, hidden)
    return shapes | {"2.bias": (hidden,), "4.bias": (n_classes,)}

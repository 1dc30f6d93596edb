"""A trained network's convolutions, with what is done to their inputs and outputs in them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Weights = NDArray[np.float32]

# torch.nn.BatchNorm2d's default.
_EPSILON = 1e-5


def folded_convolutions(
    weights: Mapping[str, Weights], n_layers: int
) -> list[tuple[Weights, Weights]]:
    """Return kernel and bias of every convolution of `nbv.estimation.networks`, for depth codes.

    Codes are divided by 128, as `nbv.estimation.images.to_input` does, in the first kernel. Batch
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

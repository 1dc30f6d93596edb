"""A bundle's network in numpy: convolutions as products of matrices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from nbv.robot.folding import folded_convolutions
from nbv.robot.mirror import Network

Array = NDArray[np.float32]

MOST_AT_ONCE = 2**18
"""Multiplications in one product of matrices, where rows can be parted.

OpenBLAS divides larger ones among threads, which wait for each other where other programs hold the
cores. Smaller ones take no longer, and an image's sums do not depend on those next to it.
"""

_IMAGES_AT_ONCE = 16


def numpy_network(weights: Mapping[str, Array], settings: Mapping[str, Any]) -> Network:
    """Return the network of some weights, from codes (n, side, side) to logits (n, B).

    Convolutions are as of `nbv.robot.folding.folded_convolutions`.

    Parameters
    ----------
    weights : mapping
        By their names in the network's state.
    settings : mapping
        Those of the estimator.
    """
    convolutions = [
        (_by_rows(kernel.transpose(2, 3, 1, 0)), bias, kernel.shape[-1])
        for kernel, bias in folded_convolutions(weights, len(settings["channels"]))
    ]
    # The last maps lie pixel by pixel here, and channel by channel in the weights.
    wide = weights["2.weight"].reshape(settings["hidden"], settings["channels"][-1], -1)
    hidden = _by_rows(wide.transpose(2, 1, 0)), weights["2.bias"]
    last = _by_rows(weights["4.weight"].T), weights["4.bias"]

    def logits(codes: NDArray[np.uint8]) -> Array:
        maps: NDArray[Any] = codes[:, :, :, None]
        for kernel, bias, size in convolutions:
            maps = _rectified(_product(_patches(maps, size), kernel, bias))
        flat = maps.reshape(len(maps), 1, 1, len(hidden[0]))
        return _product(_rectified(_product(flat, *hidden)), *last)[:, 0, 0]

    def network(codes: NDArray[np.uint8]) -> Array:
        starts = range(0, max(len(codes), 1), _IMAGES_AT_ONCE)
        return np.concatenate([logits(codes[start : start + _IMAGES_AT_ONCE]) for start in starts])

    return network


def _by_rows(weights: Array) -> Array:
    """Return weights (..., outputs) as a matrix with a row for each input."""
    return np.ascontiguousarray(weights.reshape(-1, weights.shape[-1]))


def _patches(maps: NDArray[Any], size: int) -> Array:
    """Return what each output of a convolution with stride 2 sees of maps (n, side, side, c).

    Returns
    -------
    (n, s, s, size * size * c) float32
        s is half of the side, rounded up. Outside the maps are zeros.
    """
    n, side, _, channels = maps.shape
    reach = size // 2
    padded = np.zeros((n, side + 2 * reach, side + 2 * reach, channels), dtype=np.float32)
    padded[:, reach : reach + side, reach : reach + side] = maps
    image, row, pixel, channel = padded.strides
    half = (side + 1) // 2
    # The pixels of a patch's row are neighbours in memory.
    shape = n, half, half, size, size * channels
    seen = as_strided(padded, shape, (image, 2 * row, 2 * pixel, row, channel), writeable=False)
    return seen.reshape(n, half, half, size * size * channels)


def _product(rows: Array, matrix: Array, bias: Array) -> Array:
    """Return rows (n, s, s, k) times a matrix (k, m), plus a bias, (n, s, s, m)."""
    n, side, _, k = rows.shape
    most = max(MOST_AT_ONCE // matrix.size, 1)
    together = next(size for size in range(min(most, side**2), 0, -1) if side**2 % size == 0)
    found: Array = np.matmul(rows.reshape(-1, together, k), matrix)
    found += bias
    return found.reshape(n, side, side, matrix.shape[1])


def _rectified(values: Array) -> Array:
    np.maximum(values, 0, out=values)
    return values

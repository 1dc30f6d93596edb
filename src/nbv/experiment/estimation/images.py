"""From stored depth codes to the network's input."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from nbv.experiment.estimation.hardware import Hardware


def to_input(codes: NDArray[np.uint8], hardware: Hardware) -> torch.Tensor:
    """Return images ready for a network, resident on its device.

    Parameters
    ----------
    codes : ndarray (..., side, side) uint8
        Depth codes of `nbv.data.depth_codes`: 0 is background, 128 the reference depth.
    hardware : Hardware

    Returns
    -------
    Tensor (n, 1, side, side)
        Codes divided by 128, so that the background is 0 and what is visible lies around 1; exact
        in bfloat16, whose 8 significant bits hold every code.
    """
    side = codes.shape[-1]
    flat = torch.from_numpy(np.ascontiguousarray(codes).reshape(-1, 1, side, side))
    scaled = flat.to(hardware.device).to(hardware.dtype).mul_(1 / 128)
    return scaled.contiguous(memory_format=torch.channels_last)

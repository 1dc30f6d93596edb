"""Drawing depth images: nearer is brighter, and what lies behind the object is paper white."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from nbv.data.depth_images import Codes
from nbv.robot.style import MUTED

_FAR_GREY, _NEAR_GREY = 0.12, 0.86
_BACKGROUND = 0


def depth_limits(images: Codes) -> tuple[int, int]:
    """Return the farthest and nearest code of some images, for one grey scale among them."""
    seen = images[images != _BACKGROUND]
    return (int(seen.min()), int(seen.max())) if seen.size else (1, 255)


def shade(codes: Codes, limits: tuple[int, int]) -> NDArray[np.float64]:
    """Return grey levels in [0, 1]: dark far, light near, and white where nothing was hit.

    The nearest grey stays short of white, so that the outline shows.
    """
    low, high = limits
    nearness = (codes.astype(np.float64) - low) / max(high - low, 1)
    grey = _FAR_GREY + (_NEAR_GREY - _FAR_GREY) * np.clip(nearness, 0.0, 1.0)
    return np.where(codes == _BACKGROUND, 1.0, grey)


def draw_depth(axes: Axes, codes: Codes, limits: tuple[int, int], title: str = "") -> None:
    """Fill the axes with one image in a thin frame."""
    axes.imshow(shade(codes, limits), cmap="gray", vmin=0.0, vmax=1.0, interpolation="none")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(MUTED)
        spine.set_linewidth(0.6)
    if title:
        axes.set_title(title)

"""Why a frame is refused: each reason has a name, and says what was seen."""

from __future__ import annotations

from nbv.errors import NamedError


class FrameError(NamedError):
    """Frames that no estimate should be made of; its name is the reason.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> frame = nbv.example_frame()
    >>> try:
    ...     nbv.Recommender.load("mug").recommend(frame.depth_m, mask=np.zeros((480, 640)))
    ... except nbv.FrameError as error:
    ...     error.name
    'empty-mask'
    """

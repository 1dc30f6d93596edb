"""Why a frame is refused: each reason has a name, and says what was seen."""

from __future__ import annotations

from nbv.errors import UserError


class FrameError(UserError):
    """A frame that no estimate should be made of.

    Attributes
    ----------
    name : str
        Of the reason, such as ``empty-mask``; stable, for programs.

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

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name

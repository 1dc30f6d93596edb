"""What every answer has: the expected error of a pose, and ranked moves of the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from nbv.numbers import Pose

UNKNOWN_DEG = math.nan


@dataclass(frozen=True, kw_only=True)
class RankedMove:
    """A move of the camera, and what is expected after it.

    Attributes
    ----------
    travel_deg : float
        The angle about the object between the last view and the next, in [0, 180].
    expected_error_deg : float
        Expected error of the pose once the new view is added; NaN if it is unknown.
    probability_within : dict of str to float
        Probability that this error is at most 5, 15 and 30 degrees; empty if it is unknown.
    target_camera_pose : ndarray (4, 4) or None
        The camera's pose after the move, if it is known.
    """

    travel_deg: float
    expected_error_deg: float = UNKNOWN_DEG
    probability_within: dict[str, float] = field(default_factory=dict)
    target_camera_pose: Pose | None = None

    @property
    def name(self) -> str:
        """The move in a list."""
        raise NotImplementedError

    @property
    def instruction(self) -> str:
        """What to do, in a few words."""
        return self.name

    @property
    def extent(self) -> str:
        """How far the move goes."""
        return f"travel {round(self.travel_deg, 1):g}°"


AnyMove = TypeVar("AnyMove", bound=RankedMove)


@dataclass(frozen=True, kw_only=True)
class Answer(Generic[AnyMove]):
    """The estimated pose of an object, and moves of the camera, best first.

    Attributes
    ----------
    expected_error_deg : float
        Expected error of the pose; NaN if it is unknown.
    probability_within : dict of str to float
        Probability that this error is at most 5, 15 and 30 degrees; empty if it is unknown.
    moves : tuple of RankedMove
        Best first; empty if there is no further view.
    warnings : tuple of str
        Likely mistakes, and whether no view is better than another; a sentence each.
    """

    expected_error_deg: float = UNKNOWN_DEG
    probability_within: dict[str, float] = field(default_factory=dict)
    moves: tuple[AnyMove, ...]
    warnings: tuple[str, ...] = ()

    @property
    def move(self) -> AnyMove | None:
        """The best move; None if there is no further view."""
        return self.moves[0] if self.moves else None

    @property
    def alternatives(self) -> tuple[AnyMove, ...]:
        """The other moves, best first."""
        return self.moves[1:]

    def is_enough(self, until_deg: float | None) -> bool | None:
        """Return whether the expected error is at most `until_deg`; None without it."""
        return None if until_deg is None else self.expected_error_deg <= until_deg

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        raise NotImplementedError

    def value(self, about: Any) -> str:
        """Return the expected error of the answer, or after a move, as text."""
        error, p = next(iter(about.probability_within.items()))
        percent = ">99%" if p > 0.994 else f"{p:.0%}"
        return f"expected error {about.expected_error_deg:.1f}° ({percent} within {error}°)"

    def short_value(self, move: AnyMove) -> str:
        """Return the expected error after a move as a number with its unit."""
        return f"{move.expected_error_deg:.1f}°"

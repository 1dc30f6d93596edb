"""What every answer has: the error of a pose, ranked moves of the camera, and a decision."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Literal, TypeVar

from nbv.choice.rotations import GUESS, MIN_SEPARATION_DEG, as_limit_deg
from nbv.errors import UserError
from nbv.poses import Pose

UNKNOWN_DEG = math.nan

NO_MOVE = f"all candidates are within {MIN_SEPARATION_DEG:g}° of an existing view"
NO_GAIN = "no admissible view alone is expected to lower the error by more than its noise"
NO_ERROR = "the table holds costs, no errors in degrees; calibrate with criterion expected_error"
NOT_ALIKE = "; the first is recalibrated, the second raised for the choice; without both it falls"


@dataclass(frozen=True)
class Decision:
    """Whether a further view is worth a move.

    Attributes
    ----------
    verdict : "enough", "one more view", "no view helps" or None
        None where the errors that decide are unknown.
    reason : str
        Why, in a few words.
    """

    verdict: Literal["enough", "one more view", "no view helps"] | None
    reason: str


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
    helps : bool or None
        Whether a candidate is expected to lower the error by more than its noise; None if that is
        unknown.
    no_flips : bool
        Whether calibration shows no flips of the object, and the estimates agree: enough, unless
        limits are given.
    frame_id : str or None
        The frame of the target camera poses, if a ROS message named it.
    """

    STOP_PROBABILITY: ClassVar[float | None] = None
    STOP_WITHIN_DEG: ClassVar[float] = math.nan

    expected_error_deg: float = UNKNOWN_DEG
    probability_within: dict[str, float] = field(default_factory=dict)
    moves: tuple[AnyMove, ...]
    warnings: tuple[str, ...] = ()
    helps: bool | None = None
    no_flips: bool = False
    frame_id: str | None = None

    @property
    def frame(self) -> str:
        """The frame of the moves' targets."""
        return "base frame"

    @property
    def move(self) -> AnyMove | None:
        """The best move; None if there is no further view."""
        return self.moves[0] if self.moves else None

    @property
    def alternatives(self) -> tuple[AnyMove, ...]:
        """The other moves, best first."""
        return self.moves[1:]

    def probability(self, within_deg: float) -> float:
        """Return the probability that the pose errs by at most 5, 15 or 30 degrees."""
        known = self.probability_within
        if f"{within_deg:g}" not in known:
            raise UserError(f"`within_deg`={within_deg:g}: give {', '.join(known) or 'none'}")
        return known[f"{within_deg:g}"]

    @property
    def decision(self) -> Decision:
        """The decision of `decide` without limits."""
        return self.decide()

    def decide(
        self,
        until_deg: float | None = None,
        until_probability: float | None = None,
        within_deg: float | None = None,
    ) -> Decision:
        """Return whether the pose is good enough, one more view is worth it, or no view helps.

        Raise UserError where a limit is out of range, or the answer does not know what it is about.

        Parameters
        ----------
        until_deg : float, optional
            The largest expected error that is enough; of several limits all have to hold.
        until_probability : float, optional
            The least probability, above 0 and below 1, that the error is at most `within_deg`.
            Without limits it is `STOP_PROBABILITY`, if the class has one.
        within_deg : float, optional
            By default `STOP_WITHIN_DEG`.
        """
        if until_probability is None and within_deg is not None:
            raise UserError("`within_deg` is for `until_probability`; give that too")
        if until_probability is not None and not 0.0 < until_probability < 1.0:
            raise UserError(f"`until_probability`={until_probability:g}: give one between 0 and 1")
        has_limits = (until_deg, until_probability) != (None, None)
        now_deg = self.expected_error_deg
        if math.isnan(now_deg):
            if has_limits:
                raise UserError(NO_ERROR)
            return Decision(None, NO_ERROR)
        is_met: dict[str, bool] = {}
        if until_deg is not None:
            is_enough = now_deg <= as_limit_deg("until_deg", until_deg)
            is_met[f"expected error {now_deg:.1f}°"] = is_enough
        least = until_probability if has_limits else self.STOP_PROBABILITY
        if self.no_flips and not has_limits:
            is_met["calibration shows no flips"] = True
        elif least is not None:
            within_deg = self.STOP_WITHIN_DEG if within_deg is None else within_deg
            p = self.probability(within_deg)
            is_met[_chance(p, within_deg)] = p >= least
        if is_met and all(is_met.values()):
            return Decision("enough", ", ".join(is_met))
        if (move := self.move) is None:
            return Decision("no view helps", NO_MOVE)
        if self.helps is False:
            return Decision("no view helps", GUESS if GUESS in self.warnings else NO_GAIN)
        gain = f"expected error {now_deg:.1f}° → {move.expected_error_deg:.1f}°"
        why = "" if move.expected_error_deg < now_deg else NOT_ALIKE
        return Decision("one more view", f"{move.instruction}: {gain}{why}")

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        raise NotImplementedError

    def value(self, about: Any) -> str:
        """Return the expected error of the answer, or after a move, as text."""
        error, p = next(iter(about.probability_within.items()))
        return f"expected error {about.expected_error_deg:.1f}° ({_chance(p, float(error))})"

    def short_value(self, move: AnyMove) -> str:
        """Return the expected error after a move as a number with its unit."""
        return f"{move.expected_error_deg:.1f}°"


def _chance(p: float, within_deg: float) -> str:
    percent = ">99%" if p > 0.994 else f"{p:.0%}"
    return f"{percent} within {within_deg:g}°"

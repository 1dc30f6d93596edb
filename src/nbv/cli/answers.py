"""What the commands print, for people and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from nbv.labels import counted

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from nbv.core.offset import Offset
    from nbv.robot.next_view import Recommendation

Place = tuple["NDArray[np.float64]", "list[float]", "list[float]"]
"""A camera's pose in the base frame, and a point and the direction of the object's axis."""


def say(line: str) -> None:
    """Print a line."""
    print(line)  # noqa: T201


def say_json(value: Any) -> None:
    """Print JSON, indented, in characters that every encoding has."""
    say(json.dumps(value, indent=2))


def say_assumed_camera(focal_px: float, n_frames: int | None = None) -> None:
    """Say which focal length is assumed, and of how many frames where that is known."""
    of_frames = "" if n_frames is None else f" for {counted(n_frames, 'frame')}"
    say(f"camera     not given{of_frames}: a focal length of {focal_px:g} px is assumed")


def target_poses(
    rotations_deg: Iterable[float], place: Place | None
) -> list[NDArray[np.float64]] | None:
    """Return the camera's poses (4, 4) after each of several rotations, where its own is known."""
    from nbv.robot.moves import moved_camera

    if place is None:
        return None
    return [moved_camera(*place, rotation_deg) for rotation_deg in rotations_deg]


def with_targets(
    moves: Sequence[Mapping[str, Any]], targets: Sequence[NDArray[np.float64]] | None
) -> list[dict[str, Any]]:
    """Return moves for JSON, each with the camera's pose after it where that is known."""
    if targets is None:
        return [dict(move) for move in moves]
    return [
        {**move, "target_camera_pose": target.tolist()}
        for move, target in zip(moves, targets, strict=True)
    ]


def say_warnings(warnings: Iterable[str]) -> None:
    """Print warnings, a line each."""
    for warning in warnings:
        say(f"warning: {warning}")


def say_target(targets: Sequence[NDArray[np.float64]] | None) -> None:
    """Print the camera's pose after the best move, where it is known and there is a move."""
    if not targets:
        return
    say("target camera pose in the base frame")
    for row in targets[0]:
        say("  " + " ".join(f"{value:9.5f}" for value in row))


_KEYS = (
    "azimuth_deg",
    "spread_deg",
    "expected_error_deg",
    "move",
    "alternatives",
    "ood_score",
    "bayes_factor",
    "warnings",
    "assumed_focal_px",
    "object_position_m",
    "belief",
    "error_after_deg",
)
"""What every answer has, in this order; None where it is not known."""


def _as_json(
    known: Mapping[str, Any],
    moves: Sequence[Mapping[str, Any]],
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
) -> dict[str, Any]:
    """Return an answer for JSON, of what is known of the pose and of moves, best first."""
    listed = with_targets(moves, targets)
    best = listed[0] if listed else None
    told = {"move": best, "alternatives": listed[1:], "warnings": list(warnings)}
    about = dict.fromkeys(_KEYS) | dict(known) | told
    if targets is not None:
        about["target_camera_pose"] = best["target_camera_pose"] if best else None
    return about


def recommendation_as_json(
    answer: Recommendation,
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
    assumed_focal_px: float | None = None,
) -> dict[str, Any]:
    """Return a recommendation for JSON.

    Parameters
    ----------
    answer : Recommendation
    warnings : iterable of str
        Those of the answer, and of the camera's pose.
    targets : sequence of ndarray (4, 4), optional
        The camera's pose after the move and after each alternative.
    assumed_focal_px : float, optional
        Pixels; None where intrinsics were given.
    """
    known = {
        "azimuth_deg": answer.azimuth_deg,
        "spread_deg": answer.spread_deg,
        "expected_error_deg": answer.expected_error_deg,
        "ood_score": None if math.isnan(answer.ood_score) else answer.ood_score,
        "bayes_factor": answer.bayes_factor,
        "assumed_focal_px": assumed_focal_px,
        "object_position_m": answer.object_position_m,
        "belief": answer.belief.tolist(),
        "error_after_deg": [None if e == float("inf") else e for e in answer.error_after_deg],
    }
    return _as_json(known, [asdict(move) for move in answer.moves], warnings, targets)


def table_answer_as_json(
    estimate_deg: float,
    criterion: str,
    cost_unit: str,
    ranked: Iterable[tuple[float, float]],
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
) -> dict[str, Any]:
    """Return a lookup table's rotations and their costs, best first, as `recommendation_as_json`.

    In addition it has the criterion, the unit of its cost, and the cost of each move.
    """
    moves = [
        {"rotation_deg": rotation, "travel_deg": abs(rotation), "expected_error_deg": None}
        | {"cost": cost}
        for rotation, cost in ranked
    ]
    about = {"criterion": criterion, "cost_unit": cost_unit}
    return _as_json({"azimuth_deg": estimate_deg % 360.0}, moves, warnings, targets) | about


def say_recommendation(
    answer: Recommendation,
    thing: str,
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
) -> None:
    """Print a recommendation for a thing, such as a mug, in a few lines."""
    say(
        f"pose       azimuth {answer.azimuth_deg:.1f}° (camera around {thing}); "
        f"expected error {answer.expected_error_deg:.1f}°, spread {answer.spread_deg:.1f}° "
        f"({counted(answer.n_views, 'view')})"
    )
    if (move := answer.move) is None:
        say("next view  none: all candidates are within 15° of an existing view")
    else:
        say(
            f"next view  turn by {move.rotation_deg:+g}° (travel {move.travel_deg:g}°): "
            f"expected error {move.expected_error_deg:.1f}°"
        )
    if answer.alternatives:
        others = (
            f"{m.rotation_deg:+g}° ({m.expected_error_deg:.1f}°)" for m in answer.alternatives
        )
        say(f"or         {', '.join(others)}")
    say_warnings(warnings)
    say_target(targets)


def say_offset(name: str, number: str, offset: Offset, *, is_added: bool = False) -> None:
    """Print the offset of a recording or a file, and whether calibration adds it to azimuths."""
    done = ", added to the azimuths" if is_added else ""
    say(f"{name}: {number}; offset {offset.offset_deg:+.1f}°{done}")
    if offset.warning:
        say_warnings([offset.warning])


def say_evaluation(found: pd.DataFrame, familiar: pd.DataFrame) -> None:
    """Print the errors of every recording, a line for each way to choose views.

    Parameters
    ----------
    found : DataFrame
        From `nbv.robot.evaluation.evaluate`.
    familiar : DataFrame
        From `nbv.robot.evaluation.count_ood`.
    """
    for about in familiar.to_dict("records"):
        is_own = (found["object_id"] == about["object_id"]) & (
            found["sequence"] == about["sequence"]
        )
        rows = found[is_own]
        say(
            f"{about['object_id']}, sequence {about['sequence']}: "
            f"{counted(about['n_frames'], 'frame')}; "
            f"offset {rows['offset_deg'].iloc[0]:+.1f}°; {about['n_ood']} unfamiliar, "
            f"{about['n_wrong']} wrong by more than 45°, {about['n_wrong_ood']} both"
        )
        if about["warning"]:
            say_warnings([about["warning"]])
        numbers = sorted(rows["n_views"].unique())
        say(f"  {'MAE (without offset), degrees':<30}" + "".join(f"{n:>15}" for n in numbers))
        for choice in dict.fromkeys(rows["choice"]):
            of_choice = rows[rows["choice"] == choice].set_index("n_views")
            cells = (
                f"{of_choice['mae_deg'][n]:.1f} ({of_choice['mae_without_offset_deg'][n]:.1f})"
                if n in of_choice.index
                else ""
                for n in numbers
            )
            say(f"  {choice:<30}" + "".join(f"{cell:>15}" for cell in cells))


def say_names(about: Mapping[str, Any]) -> None:
    """Print names and values, one a line; of a mapping its own names and values."""
    shown = dict(_flat(about))
    width = max(map(len, shown))
    for name, value in shown.items():
        say(f"{name:<{width}}  {value}")


def _flat(about: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value

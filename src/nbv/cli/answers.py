"""Print the answers of commands, as text or as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from nbv.errors import printable
from nbv.labels import counted

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from nbv.core.offset import Offset
    from nbv.robot.next_camera import CameraMove, CameraRecommendation
    from nbv.robot.next_view import Move, Recommendation

Placement = tuple["NDArray[np.float64]", "list[float]", "list[float]"]
"""Camera pose in the base frame, point on the object's axis, and direction of the axis."""


def print_line(line: str) -> None:
    """Print a line; what a file says, such as a bundle's category, is escaped."""
    print(printable(line))  # noqa: T201


def print_json(value: Any) -> None:
    """Print indented ASCII JSON."""
    print(json.dumps(value, indent=2))  # noqa: T201


def print_assumed_camera(focal_px: float, n_frames: int | None = None) -> None:
    """Print the assumed focal length, and the number of frames if it is given."""
    frames = "" if n_frames is None else f" for {counted(n_frames, 'frame')}"
    print_line(f"camera     not given{frames}: a focal length of {focal_px:g} px is assumed")


def target_poses(
    rotations_deg: Iterable[float], placement: Placement | None
) -> list[NDArray[np.float64]] | None:
    """Return the camera's pose (4, 4) after each rotation; None without a placement."""
    from nbv.robot.moves import moved_camera

    if placement is None:
        return None
    return [moved_camera(*placement, rotation_deg) for rotation_deg in rotations_deg]


def with_targets(
    moves: Sequence[Mapping[str, Any]], targets: Sequence[NDArray[np.float64]] | None
) -> list[dict[str, Any]]:
    """Return moves for JSON, each with the camera's pose after it if that is known."""
    if targets is None:
        return [dict(move) for move in moves]
    return [
        {**move, "target_camera_pose": target.tolist()}
        for move, target in zip(moves, targets, strict=True)
    ]


def print_warnings(warnings: Iterable[str]) -> None:
    """Print one line for each warning."""
    for warning in warnings:
        print_line(f"warning: {warning}")


def print_target(targets: Sequence[NDArray[np.float64]] | None) -> None:
    """Print the camera's pose after the best move, if both exist."""
    if not targets:
        return
    print_line("target camera pose in the base frame")
    for row in targets[0]:
        print_line("  " + " ".join(f"{value:9.5f}" for value in row))


_KEYS = (
    "azimuth_deg",
    "spread_deg",
    "expected_error_deg",
    "probability_within",
    "enough",
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
"""Keys of every answer, in this order; the values of unknown ones are None."""


def _as_json(
    known: Mapping[str, Any],
    moves: Sequence[Mapping[str, Any]],
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
) -> dict[str, Any]:
    """Return an answer for JSON from known values and moves, best first."""
    listed = with_targets(moves, targets)
    best = listed[0] if listed else None
    given = {"move": best, "alternatives": listed[1:], "warnings": list(warnings)}
    about = dict.fromkeys(_KEYS) | dict(known) | given
    if targets is not None:
        about["target_camera_pose"] = best["target_camera_pose"] if best else None
    return about


def recommendation_as_json(
    answer: Recommendation,
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
    assumed_focal_px: float | None = None,
    enough: bool | None = None,
) -> dict[str, Any]:
    """Return a recommendation for JSON, with all warnings and the camera's poses after its moves.

    `assumed_focal_px` is None if intrinsics were given, `enough` without ``--until``.
    """
    known = {
        "azimuth_deg": answer.azimuth_deg,
        "spread_deg": answer.spread_deg,
        "expected_error_deg": answer.expected_error_deg,
        "probability_within": answer.probability_within,
        "enough": enough,
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
    """Return a lookup table's rotations and costs, best first, for JSON.

    The keys are those of `recommendation_as_json`, and the criterion, the unit of its cost, and the
    cost of each move.
    """
    moves = [
        {"rotation_deg": rotation, "travel_deg": abs(rotation), "cost": cost}
        | dict.fromkeys(("expected_error_deg", "probability_within"))
        for rotation, cost in ranked
    ]
    about = {"criterion": criterion, "cost_unit": cost_unit}
    return _as_json({"azimuth_deg": estimate_deg % 360.0}, moves, warnings, targets) | about


def camera_answer_as_json(answer: CameraRecommendation, enough: bool | None) -> dict[str, Any]:
    """Return ranked camera poses for JSON: the keys of every answer, and those of rotations."""
    moves = [
        asdict(move)
        | {"rotation_deg": None, "direction": move.direction.tolist()}
        | {"target_camera_pose": None if (t := move.target_camera_pose) is None else t.tolist()}
        for move in answer.moves
    ]
    known = {
        "expected_error_deg": answer.expected_error_deg,
        "rotation": answer.rotation.tolist(),
        "probability_within": answer.probability_within,
        "depends_on_view": answer.depends_on_view,
        "enough": enough,
        "target_camera_pose": moves[0]["target_camera_pose"],
    }
    return _as_json(known, moves, answer.warnings, None)


def print_camera_answer(answer: CameraRecommendation, enough: bool | None) -> None:
    """Print ranked camera poses in a few lines."""
    print_line(f"pose       expected error {answer.expected_error_deg:.1f}°, {_chances(answer)}")
    _print_enough(enough)
    for move, head in zip(answer.moves[:6], ["next view", *[""] * 5], strict=False):
        metres = "" if move.travel_m is None else f", {move.travel_m:.2f} m"
        print_line(
            f"{head:<10} candidate {move.index}, travel {move.travel_deg:.0f}°{metres}: "
            f"expected error {move.expected_error_deg:.1f}°, {_chances(move)}"
        )
    print_warnings(answer.warnings)
    best = answer.moves[0].target_camera_pose
    print_target(None if best is None else [best])


def _chances(about: CameraRecommendation | CameraMove) -> str:
    chances = about.probability_within.items()
    return ", ".join(f"{_percent(p)} within {error}°" for error, p in chances)


def _chance(about: Recommendation | Move) -> str:
    """Return the probability of the smallest error."""
    error, p = next(iter(about.probability_within.items()))
    return f" ({_percent(p)} within {error}°)"


def _percent(p: float) -> str:
    return ">99%" if p > 0.994 else f"{p:.0%}"


def _print_enough(enough: bool | None) -> None:
    if enough is not None:
        print_line(f"           {'enough: stop here' if enough else 'one more view'}")


def print_recommendation(
    answer: Recommendation,
    category: str,
    warnings: Iterable[str],
    targets: Sequence[NDArray[np.float64]] | None,
    enough: bool | None = None,
) -> None:
    """Print a recommendation for an object of a category in a few lines."""
    print_line(
        f"pose       azimuth {answer.azimuth_deg:.1f}° (camera around {category}; "
        f"{counted(answer.n_views, 'view')})"
    )
    print_line(
        f"           expected error {answer.expected_error_deg:.1f}°{_chance(answer)}, "
        f"spread {answer.spread_deg:.1f}°"
    )
    _print_enough(enough)
    if (move := answer.move) is None:
        print_line("next view  none: all candidates are within 15° of an existing view")
    else:
        print_line(
            f"next view  turn by {move.rotation_deg:+g}° (travel {move.travel_deg:g}°): "
            f"expected error {move.expected_error_deg:.1f}°{_chance(move)}"
        )
    if answer.alternatives:
        others = (
            f"{m.rotation_deg:+g}° ({m.expected_error_deg:.1f}°)" for m in answer.alternatives
        )
        print_line(f"or         {', '.join(others)}")
    print_warnings(warnings)
    print_target(targets)


def print_offset(name: str, number: str, offset: Offset, *, is_added: bool = False) -> None:
    """Print the offset of a recording or a file, and whether it is added to the azimuths."""
    added = ", added to the azimuths" if is_added else ""
    print_line(f"{name}: {number}; offset {offset.offset_deg:+.1f}°{added}")
    if offset.warning:
        print_warnings([offset.warning])


def print_evaluation(errors: pd.DataFrame, ood: pd.DataFrame) -> None:
    """Print the errors of every recording, one line for each way to choose views.

    The frames are those of `evaluate` and `count_ood` in `nbv.robot.evaluation`.
    """
    from nbv.robot.evaluation import RECOMMENDED, SINGLE, UNTIL

    for about in ood.to_dict("records"):
        is_recording = (errors["object_id"] == about["object_id"]) & (
            errors["sequence"] == about["sequence"]
        )
        rows = errors[is_recording]
        print_line(
            f"{about['object_id']}, sequence {about['sequence']}: "
            f"{counted(about['n_frames'], 'frame')}; "
            f"offset {rows['offset_deg'].iloc[0]:+.1f}°; {about['n_ood']} out of distribution, "
            f"{about['n_wrong']} wrong by more than 45°, {about['n_wrong_ood']} both"
        )
        if about["wrong"]:
            shown = [f"{frame['file']} ({frame['error_deg']:.0f}°)" for frame in about["wrong"]]
            named = shown[:10] + ["…"] * (len(shown) > 10)
            print_line(f"  wrong, worst first: {', '.join(named)}")
        if about["warning"]:
            print_warnings([about["warning"]])
        numbers = sorted(rows["n_views"].unique())
        print_line(
            f"  {'MAE (without offset), degrees':<30}" + "".join(f"{n:>15}" for n in numbers)
        )
        is_until = rows["choice"] == UNTIL
        table = {
            choice: {
                row["n_views"]: f"{row['mae_deg']:.1f} ({row['mae_without_offset_deg']:.1f})"
                for row in of_choice.to_dict("records")
            }
            for choice, of_choice in rows[~is_until].groupby("choice", sort=False)
        }
        expected = rows[rows["choice"].isin([SINGLE, RECOMMENDED])].set_index("n_views")
        table["expected error"] = {n: f"{e:.1f}" for n, e in expected["expected_deg"].items()}
        for choice, cells in table.items():
            line = "".join(f"{cells.get(n, ''):>15}" for n in numbers)
            print_line(f"  {choice:<30}{line}")
        for row in rows[is_until].to_dict("records"):
            print_line(
                f"  {UNTIL}: {row['mae_deg']:.1f} ({row['mae_without_offset_deg']:.1f}), expected "
                f"{row['expected_deg']:.1f}, after {row['mean_views']:.1f} of at most "
                f"{row['n_views']} views"
            )


def print_names(about: Mapping[str, Any]) -> None:
    """Print names and values, one per line, with nested names joined by dots."""
    shown = dict(_flat(about))
    width = max(map(len, shown))
    for name, value in shown.items():
        print_line(f"{name:<{width}}  {value}")


def _flat(about: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value

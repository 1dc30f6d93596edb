"""Print the answers of commands, as text or as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, TypeVar

from nbv.cli.arguments import in_flags
from nbv.errors import UserError, printable
from nbv.labels import counted, matrix_lines

if TYPE_CHECKING:
    import pandas as pd

    from nbv.choice.answers import Answer
    from nbv.cli.arguments import Placement, StopOptions
    from nbv.core.circle.offset import Offset
    from nbv.poses import Pose

AnyAnswer = TypeVar("AnyAnswer", bound="Answer[Any]")

N_ALTERNATIVES = 5
"""Number of other moves in a line of text; JSON has all."""


def print_line(line: str, start: str = "") -> None:
    """Print a line after its start; what a file says, such as a category, is escaped."""
    print(start + printable(line))  # noqa: T201


def print_json(value: Any) -> None:
    """Print indented ASCII JSON."""
    print(json.dumps(value, indent=2))  # noqa: T201


def print_assumed_camera(focal_px: float, n_frames: int | None = None, start: str = "") -> None:
    """Print the assumed focal length, and the number of frames if it is given."""
    frames = "" if n_frames is None else f" for {counted(n_frames, 'frame')}"
    print_line(f"camera     not given{frames}: a focal length of {focal_px:g} px is assumed", start)


def with_targets(
    answer: AnyAnswer,
    placement: Placement | None,
    object_position_m: Sequence[float] | None = None,
    diagonal_m: float | None = None,
) -> AnyAnswer:
    """Return an answer with the camera's pose after each rotation, if its placement is known.

    Parameters and errors are those of `nbv.check_axis`, whose warnings are added.
    """
    from nbv.choice.moves import check_axis, moved_camera

    if placement is None:
        return answer
    pose, point, direction, frame_id = placement
    warnings = check_axis(pose, point, direction, object_position_m, diagonal_m)
    moves: Any = tuple(
        replace(move, target_camera_pose=moved_camera(pose, point, direction, move.rotation_deg))
        for move in answer.moves
    )
    warnings = (*answer.warnings, *warnings)
    return replace(answer, moves=moves, warnings=warnings, frame_id=frame_id)


def print_warnings(warnings: Iterable[str], start: str = "") -> None:
    """Print one line for each warning."""
    for warning in warnings:
        print_line(f"warning: {in_flags(warning)}", start)


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


_MOVE_KEYS = ("rotation_deg", "travel_deg", "expected_error_deg", "probability_within")
"""Keys of every move, in this order."""

_NOT_IN_JSON = ("crops", "n_views", "moves", "helps", "no_flips", "pose_belief")


def show_answer(
    answer: Answer[Any],
    stop: StopOptions,
    *,
    as_json: bool,
    has_targets: bool,
    seen: str = "object",
    assumed_focal_px: float | None = None,
    form: str | None = None,
    order: str = "xyzw",
) -> None:
    """Print an answer about an object, which is called `seen`, as text or as JSON.

    JSON has keys for the camera's pose after each move if the answer `has_targets`. With another
    `form` the answer is a comment above the next camera pose, whose quaternion has that order.
    """
    answer = replace(answer, warnings=tuple(map(in_flags, answer.warnings)))
    decision = answer.decide(stop.until, stop.until_probability, stop.within)
    if as_json or form == "json":
        enough = None if stop.until is None else answer.expected_error_deg <= stop.until
        about = _as_json(answer, enough, assumed_focal_px, has_targets)
        print_json(about | {"decision": asdict(decision)})
        return
    target = None if answer.move is None else answer.move.target_camera_pose
    if form is not None and target is None:
        raise UserError(
            f"--format={form}: the next camera pose is not known: give estimates with a "
            "position, or --candidates; for frames and azimuths --camera-pose and --axis"
        )
    start = "" if form is None else "# "
    print_line(f"decision   {decision.verdict or 'none'}: {decision.reason}", start)
    if assumed_focal_px is not None:
        print_assumed_camera(assumed_focal_px, start=start)
    _print_answer(answer, seen, start)
    if target is not None:
        frame = answer.frame if answer.frame_id is None else f"frame {answer.frame_id}"
        print_line(f"target camera pose in the {frame}", start)
        for line in _pose_lines(target, form, order, answer.frame_id):
            print_line(line)


def _as_json(
    answer: Answer[Any], enough: bool | None, assumed_focal_px: float | None, has_targets: bool
) -> dict[str, Any]:
    target = "target_camera_pose"
    moves = [dict.fromkeys(_MOVE_KEYS) | _plain(move) for move in answer.moves]
    best = moves[0] if moves else None
    about = dict.fromkeys(_KEYS) | _plain(answer)
    about |= {"enough": enough, "move": best, "alternatives": moves[1:]}
    about["assumed_focal_px"] = assumed_focal_px
    if has_targets:
        about[target] = best and best[target]
        return about
    for move in moves:
        del move[target]
    return about


def _plain(item: Any) -> dict[str, Any]:
    """Return the attributes of an answer or a move for JSON; what is unknown is None."""
    values = {each.name: getattr(item, each.name) for each in fields(item)}
    return {name: _value(values[name]) for name in values if name not in _NOT_IN_JSON}


def _value(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list):
        return [_value(each) for each in value]
    is_unknown = value == {} or (isinstance(value, float) and not math.isfinite(value))
    return None if is_unknown else value


def _pose_lines(pose: Pose, form: str | None, order: str, frame_id: str | None) -> list[str]:
    """Return the lines of a camera's pose as a matrix, position and quaternion, or PoseStamped."""
    if form is None:
        return matrix_lines(pose)
    if form == "4x4":
        return [_row(row) for row in pose]
    import numpy as np
    import yaml
    from scipy.spatial.transform import Rotation

    position, quaternion = pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    if form == "quaternion":
        quaternion = quaternion if order == "xyzw" else np.roll(quaternion, 1)
        return [f"# x y z (metres), quaternion {order}", _row([*position, *quaternion])]
    message = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame_id or ""},
        "pose": {
            "position": dict(zip("xyz", position.tolist(), strict=True)),
            "orientation": dict(zip("xyzw", quaternion.tolist(), strict=True)),
        },
    }
    return list(yaml.safe_dump(message, sort_keys=False).splitlines())


def _row(numbers: Iterable[float]) -> str:
    return " ".join(f"{number + 0.0:.9g}" for number in numbers)


def _print_answer(answer: Answer[Any], seen: str, start: str) -> None:
    for head, line in zip_longest(["pose"], answer.pose_lines(seen), fillvalue=""):
        print_line(f"{head:<10} {line}", start)
    if (move := answer.move) is None:
        print_line("next view  none", start)
    else:
        move_line = f"next view  {move.instruction} ({move.extent}): {answer.value(move)}"
        print_line(move_line, start)
    if others := answer.alternatives[:N_ALTERNATIVES]:
        listed = (f"{other.name} ({answer.short_value(other)})" for other in others)
        first, *errors = (each.expected_error_deg for each in answer.moves)
        why = "; lower ones are not lower by more than their noise" if first > min(errors) else ""
        print_line(f"or         {', '.join(listed)}{why}", start)
    print_warnings(answer.warnings, start)


def print_offset(name: str, number: str, offset: Offset, *, is_added: bool = False) -> None:
    """Print the offset of a recording or a file, and whether it is added to the azimuths."""
    added = ", added to the azimuths" if is_added else ""
    print_line(f"{name}: {number}; offset {offset.offset_deg:+.1f}°{added}")
    if offset.warning:
        print_warnings([offset.warning])


def print_evaluation(errors: pd.DataFrame, ood: pd.DataFrame) -> None:
    """Print the errors of every recording, one line for each way to choose views.

    The frames are those of `evaluate` and `count_ood` in `nbv.bundles.evaluation`.
    """
    from nbv.bundles.evaluation import RECOMMENDED, SINGLE, UNTIL

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

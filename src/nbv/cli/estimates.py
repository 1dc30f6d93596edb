"""The command ``nbv next``: the next view after estimates of any estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from nbv.cli.answers import show_answer, with_targets
from nbv.cli.arguments import (
    AZIMUTHS,
    DISTRIBUTIONS,
    ORIENTATIONS,
    Estimate,
    Followed,
    Format,
    Json,
    MoveOptions,
    Numbers,
    StopOptions,
    WholeNumber,
    as_paragraphs,
    check_options,
)
from nbv.errors import UserError

if TYPE_CHECKING:
    from nbv.choice.answers import Answer

KINDS = {AZIMUTHS: "cost", DISTRIBUTIONS: "distribution.of_views", ORIENTATIONS: "truth"}
"""What a table may hold, and the name of an array by which it is known."""

N_NUMBERS = {AZIMUTHS: (1,), DISTRIBUTIONS: (None,), ORIENTATIONS: (7, 9, 16, None)}
"""How many numbers --estimate may have; None for a file."""

ESTIMATES = {
    AZIMUTHS: "one number of degrees",
    DISTRIBUTIONS: "a .csv or .npy file with a row of probabilities for each view",
    ORIENTATIONS: "a pose: 9 or 16 numbers, 7 with --quaternion, or a file",
}

_FOR_ALL = ("max_travel", "camera_pose", "quaternion", "until")
_PROBABLE = ("until_probability", "within")
_ROUND_AXIS = (*_FOR_ALL, "allowed", "axis")
OPTIONS = {
    AZIMUTHS: _ROUND_AXIS,
    DISTRIBUTIONS: (*_ROUND_AXIS, "rotations", "not_followed", *_PROBABLE),
    ORIENTATIONS: (*_FOR_ALL, "object", "candidates", "sphere", "previous", *_PROBABLE),
}
"""Options for each kind of table."""


@Parameter(name="*")
@as_paragraphs
@dataclass(frozen=True)
class CandidateOptions:
    """Options for a table of orientations.

    Parameters
    ----------
    object
        The object, where a table of orientations has several.
    candidates
        Camera poses that can be reached, for a table of orientations: a file of several, like
        --camera-pose.
    sphere
        Instead of --candidates: the number of camera poses, spaced evenly around the object.
    previous
        An earlier pose, a file like that of --estimate, the last one if there are several: of the
        poses in which a symmetric object looks the same, the answer is the nearest. With the camera
        poses of both views, or without both if the camera stood still.
    """

    object: str | None = None
    candidates: Path | None = None
    sphere: WholeNumber | None = None
    previous: Path | None = None


@as_paragraphs
def next_view(
    table: Annotated[Path, Parameter(name="TABLE")],
    /,
    *,
    estimate: Estimate,
    rotations: Numbers = None,
    followed: Followed = True,
    limits: MoveOptions = MoveOptions(),
    around: CandidateOptions = CandidateOptions(),
    stop: StopOptions = StopOptions(),
    form: Format = None,
    json: Json = False,
) -> None:
    """Recommend the next view after estimates of your own estimator.

    The table says of which kind they are.

    Example: nbv next table.npz --estimate 123.4

    Example: nbv next table.npz --estimate views.csv --rotations 0 90

    Example: nbv next table.npz --estimate pose.json --sphere 50

    Parameters
    ----------
    table
        The file that nbv calibrate made for the estimator.
    estimate
        An azimuth, degrees; a file with distributions, one row for each view: CSV with columns p0,
        p1, ..., or .npy; or a pose, object to camera: a 3 x 3 or 4 x 4 matrix, 9 or 16 numbers row
        by row, or a .txt, .npy, .json or .yaml file with one or with several hypotheses or views.
    rotations
        Rotation of each view from the first one: 0 90, or 0,90, for two distributions.
    """
    kind = _kind(table, estimate)
    others = {"rotations": rotations, "not_followed": None if followed else True}
    given = vars(limits) | vars(around) | vars(stop) | others
    check_options(given, OPTIONS[kind], f"{table}, which holds {kind}")
    answer: Answer[Any]
    if kind == ORIENTATIONS:
        answer, has_targets = _ranked_cameras(table, estimate, limits, around, stop), True
    else:
        placement = limits.placement()
        if isinstance(estimate, list):
            from nbv.tables.lookup import LookupTable

            lookup = LookupTable.load(table)
            answer = lookup.rank(estimate[0], limits.allowed_deg(), limits.max_travel)
        else:
            answer = _recommended(table, estimate, limits, rotations or [0.0], followed)
        answer, has_targets = with_targets(answer, placement), placement is not None
    show_answer(
        answer,
        stop,
        as_json=json,
        has_targets=has_targets,
        form=form,
        order=limits.quaternion or "xyzw",
    )


def _kind(table: Path, estimate: list[float] | Path) -> str:
    """Return the kind of a table; with distributions it holds azimuths too."""
    import numpy as np

    from nbv.files import calibrated_file, readable

    remedy = "give the .npz file that nbv calibrate wrote"
    with readable(calibrated_file(table), remedy), np.load(table, allow_pickle=False) as stored:
        kinds = [kind for kind, name in KINDS.items() if name in stored.files]
    if not kinds:
        raise UserError(f"{table} is not a table; {remedy}")
    kind = kinds[0] if isinstance(estimate, list) else kinds[-1]
    n_numbers = len(estimate) if isinstance(estimate, list) else None
    if n_numbers not in N_NUMBERS[kind]:
        raise UserError(f"--estimate: {table} holds {kind}; give {ESTIMATES[kind]}")
    return kind


def _recommended(
    table: Path, estimate: Any, limits: MoveOptions, rotations: list[float], followed: bool
) -> Answer[Any]:
    from nbv.tables.distribution_table import DistributionTable
    from nbv.tables.pairs import read_distributions

    return DistributionTable.load(table).recommend(
        read_distributions(estimate),
        rotations,
        allowed_deg=limits.allowed_deg(),
        max_travel_deg=limits.max_travel,
        followed=followed,
    )


def _ranked_cameras(
    table: Path,
    estimate: Any,
    limits: MoveOptions,
    around: CandidateOptions,
    stop: StopOptions,
) -> Answer[Any]:
    if (around.candidates is None) == (around.sphere is None):
        raise UserError("--candidates and --sphere: give one of them")
    from nbv.poses import read_pose, read_poses
    from nbv.tables.next_camera import read_views
    from nbv.tables.orientation_table import OrientationTable

    order, camera = limits.quaternion, limits.camera_pose
    answer = OrientationTable.load(table).recommend(
        read_views(estimate, order),
        around.sphere or 0 if around.candidates is None else read_poses(around.candidates, order),
        object_id=around.object,
        camera_pose=None if camera is None else read_pose(camera, order),
        max_travel_deg=limits.max_travel,
        previous=None if around.previous is None else read_views(around.previous, order)[-1],
    )
    if (stop.until, stop.until_probability) == (None, None):
        return answer
    kept = {name: of for name, of in answer.bounds_deg.items() if name != "stopped"}
    return replace(answer, bounds_deg=kept)

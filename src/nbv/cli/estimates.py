"""The command ``nbv next``: the next view after estimates of any estimator."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from nbv.cli.answers import answer_as_json, print_answer, print_json, with_targets
from nbv.cli.arguments import (
    ANY_MOVE,
    AZIMUTHS,
    DISTRIBUTIONS,
    ORIENTATIONS,
    Estimate,
    Json,
    MoveOptions,
    Numbers,
    as_paragraphs,
    check_options,
)
from nbv.errors import UserError

if TYPE_CHECKING:
    from nbv.choice.answers import Answer

KINDS = {AZIMUTHS: "cost", DISTRIBUTIONS: "distribution.of_views", ORIENTATIONS: "truth"}
"""What a table may hold, and the name of an array by which it is known."""

ESTIMATES = {
    AZIMUTHS: "one number of degrees",
    DISTRIBUTIONS: "a .csv or .npy file with a row of probabilities for each view",
    ORIENTATIONS: "9 numbers, or a .json or .npy file",
}

_ROUND_AXIS = ("--allowed", "--axis")
OPTIONS = {
    AZIMUTHS: _ROUND_AXIS,
    DISTRIBUTIONS: (*_ROUND_AXIS, "--rotations", "--not-followed", "--until"),
    ORIENTATIONS: ("--object", "--candidates", "--sphere", "--until"),
}
"""Options for some tables only."""


@Parameter(name="*")
@as_paragraphs
@dataclass(frozen=True)
class CandidateOptions:
    """Options for a table of orientations.

    Parameters
    ----------
    object_id
        The object, where a table of orientations has several.
    candidates
        Camera poses that can be reached, for a table of orientations: 16 numbers each, like
        --camera-pose.
    sphere
        Instead of --candidates: the number of camera poses, spaced evenly around the object.
    """

    object_id: Annotated[str | None, Parameter(name="--object")] = None
    candidates: Path | None = None
    sphere: int | None = None


ANY_CANDIDATE = CandidateOptions()


@as_paragraphs
def next_view(
    table: Annotated[Path, Parameter(name="TABLE")],
    /,
    *,
    estimate: Estimate,
    rotations: Numbers = None,
    followed: Annotated[bool, Parameter(negative="--not-followed")] = True,
    limits: MoveOptions = ANY_MOVE,
    around: CandidateOptions = ANY_CANDIDATE,
    until: float | None = None,
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
        p1, ..., or .npy; or the 9 numbers of a rotation matrix, object to camera, or a .json or
        .npy file with several hypotheses or views.
    rotations
        Rotation of each view from the first one: 0 90, or 0,90, for two distributions.
    followed
        Whether a recommendation chose the last of several views. The expected error is then raised,
        because the same errors chose the view. Give --not-followed for a turntable or fixed
        cameras.
    until
        An expected error, degrees. If that of the pose is not above it, the answer is: enough.
    json
        Print JSON.
    """
    kind = _kind(table, estimate)
    given = {
        "--allowed": limits.allowed,
        "--axis": limits.axis,
        "--rotations": rotations,
        "--not-followed": None if followed else True,
        "--object": around.object_id,
        "--candidates": around.candidates,
        "--sphere": around.sphere,
        "--until": until,
    }
    check_options(given, OPTIONS[kind], f"{table}, which holds {kind}")
    answer: Answer[Any]
    if kind == ORIENTATIONS:
        answer, has_targets = _ranked_cameras(table, estimate, limits, around), True
    else:
        placement = limits.placement()
        if kind == AZIMUTHS:
            answer = _ranked_rotations(table, estimate, limits)
        else:
            answer = _recommended(table, estimate, limits, rotations or [0.0], followed)
        answer, has_targets = with_targets(answer, placement), placement is not None
    enough = answer.is_enough(until)
    if json:
        print_json(answer_as_json(answer, enough, has_targets=has_targets))
        return
    print_answer(answer, enough)


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
    if n_numbers not in {AZIMUTHS: (1,), DISTRIBUTIONS: (None,), ORIENTATIONS: (9, None)}[kind]:
        raise UserError(f"--estimate: {table} holds {kind}; give {ESTIMATES[kind]}")
    return kind


def _ranked_rotations(table: Path, estimate: Any, limits: MoveOptions) -> Answer[Any]:
    from nbv.tables.lookup import LookupTable

    return LookupTable.load(table).rank(estimate[0], limits.allowed_deg(), limits.max_travel)


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
    table: Path, estimate: Any, limits: MoveOptions, around: CandidateOptions
) -> Answer[Any]:
    if (around.candidates is None) == (around.sphere is None):
        raise UserError("--candidates and --sphere: give one of them")
    from nbv.numbers import read_pose, read_poses
    from nbv.tables.next_camera import as_view, read_views
    from nbv.tables.orientation_table import OrientationTable

    return OrientationTable.load(table).recommend(
        read_views(estimate) if isinstance(estimate, Path) else [as_view(estimate, "--estimate")],
        read_poses(around.candidates) if around.candidates is not None else around.sphere or 0,
        object_id=around.object_id,
        camera_pose=None if limits.camera_pose is None else read_pose(limits.camera_pose),
        max_travel_deg=limits.max_travel,
    )

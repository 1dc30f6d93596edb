"""The command ``nbv recommend``: for frames, for estimates and for distributions."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from nbv.cli.answers import (
    camera_answer_as_json,
    print_assumed_camera,
    print_camera_answer,
    print_json,
    print_line,
    print_recommendation,
    print_target,
    print_warnings,
    recommendation_as_json,
    table_answer_as_json,
    target_poses,
)
from nbv.cli.arguments import (
    SHIPPED,
    Json,
    Numbers,
    Rotations,
    allowed_rotations,
    as_paragraphs,
    check_writable,
)
from nbv.errors import UserError
from nbv.labels import counted

if TYPE_CHECKING:
    from nbv.cli.answers import Placement

ANY_TRAVEL_DEG = 180.0

IMAGE_SUFFIXES = (".png", ".pdf", ".svg")


@as_paragraphs
def recommend(
    *frames: Annotated[Path, Parameter(name="FRAME", negative=())],
    bundle: str = SHIPPED,
    rotations: Numbers = None,
    depth_scale: float | None = None,
    intrinsics: str | None = None,
    mask: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative=())] = None,
    near: float | None = None,
    far: float | None = None,
    elevation: float | None = None,
    gravity: Numbers = None,
    allowed: Rotations = None,
    max_travel: float = ANY_TRAVEL_DEG,
    followed: Annotated[bool, Parameter(negative="--not-followed")] = True,
    camera_pose: Path | None = None,
    axis: Numbers = None,
    estimate: Rotations = None,
    distribution: Path | None = None,
    table: Path | None = None,
    object_id: Annotated[str | None, Parameter(name="--object")] = None,
    candidates: Path | None = None,
    sphere: int | None = None,
    until: float | None = None,
    plot: Path | None = None,
    json: Json = False,
) -> None:
    """Estimate the object's azimuth and recommend the next view.

    Rotations are in degrees around the object's upright axis, counter-clockwise
    seen from above.

    Example: nbv recommend frame.png --intrinsics 585,585,319.5,239.5

    Example: nbv recommend a.npy b.npy --rotations 0 90 --plot answer.png

    Parameters
    ----------
    frames
        Depth frames of one object: .npy, .npz, or 16-bit images. Floating-point depth is in metres,
        integer depth in millimetres; see --depth-scale.
    bundle
        The name of a shipped bundle, or a file.
    rotations
        Rotation of each frame from the first one: 0 90, or 0,90, for two frames.
    depth_scale
        Metres per unit of depth. Default: 1 for floating-point depth; for integer depth the value
        of the camera file, or 0.001.
    intrinsics
        fx,fy,cx,cy in pixels, only the focal length, or a camera file (BOP, ROS CameraInfo). Give
        only the focal length for a frame that was cut out of a larger image.
    mask
        Masks of the object, one for each frame. Give the frames before this option.
    near
        Least depth of the object, metres.
    far
        Largest depth of the object, metres.
    elevation
        Elevation of the camera above the object's base plane, degrees.
    gravity
        Instead of the elevation: the direction down in the camera's optical frame, x,y,z (x right,
        y down, z forward). An accelerometer at rest reports the opposite direction.
    allowed
        Admissible rotations from the last frame: degrees, ranges such as -60:60, or a .npy file of
        degrees or of n booleans, where entry k selects the rotation 360 k / n.
    max_travel
        Largest rotation of the camera, degrees.
    followed
        Whether a recommendation chose the last of several views. The expected error is then raised,
        because the same errors chose the view. Give --not-followed for a turntable or fixed
        cameras.
    camera_pose
        The camera's pose at the last view, for which the target pose is printed too: the pose of
        the optical frame (x right, y down, z forward) in the base frame, metres; the 16 numbers of
        a 4 x 4 matrix, row by row, in a .txt, .npy or .json file.
    axis
        The object's upright axis in the base frame: a point, metres, or a point and a direction.
        Default direction: 0 0 1.
    estimate
        Instead of frames: the azimuth from your own estimator, degrees. For a table of rotations:
        the 9 numbers of a rotation, object to camera, or a .json or .npy file with several
        hypotheses or views.
    distribution
        Instead of frames: a file with the distributions from your own estimator, one row for each
        view. CSV with columns p0, p1, ..., or .npy.
    table
        The file that nbv calibrate made for that estimator.
    object_id
        The object, where a table of rotations has several.
    candidates
        Camera poses that can be reached, for a table of rotations: 16 numbers each, like
        --camera-pose.
    sphere
        Instead of --candidates: so many even camera poses about the object.
    until
        An expected error, degrees. If that of the pose is not above it, the answer is: enough.
    plot
        Draw crops, belief, expected errors and the move into this file: .png, .pdf or .svg.
    json
        Print JSON.
    """
    if (table, estimate, distribution) != (None, None, None):
        frame_options: dict[str, object] = {
            "FRAME": frames or None,
            "--bundle": None if bundle == SHIPPED else bundle,
        }
        frame_options |= {"--plot": plot, "--mask": mask, "--near": near, "--far": far}
        frame_options |= {"--intrinsics": intrinsics, "--depth-scale": depth_scale}
        frame_options |= {"--elevation": elevation, "--gravity": gravity}
        if distribution is None:
            frame_options["--rotations"] = rotations
            frame_options["--not-followed"] = None if followed else True
        if ignored := [name for name, value in frame_options.items() if value is not None]:
            own = "--estimate" if distribution is None else "--distribution"
            raise UserError(f"{ignored[0]} does not go with {own} and --table; leave it out")
        if (candidates, sphere) != (None, None):
            if distribution is not None or axis is not None or allowed is not None:
                raise UserError(
                    "--candidates and --sphere go with --estimate and --table, not with "
                    "--distribution, --axis or --allowed"
                )
            _recommend_camera(
                estimate,
                table,
                object_id,
                candidates,
                sphere,
                camera_pose,
                max_travel,
                until,
                as_json=json,
            )
            return
        if object_id is not None:
            raise UserError("--object goes with --candidates or --sphere")
        if until is not None and distribution is None:
            raise UserError("--until needs an expected error: frames, --distribution, or rotations")
        placement = _read_placement(camera_pose, axis)
        if distribution is None:
            if isinstance(estimate, Path) or len(estimate or [0]) > 1:
                raise UserError(
                    "a rotation needs --candidates or --sphere; an azimuth is one number"
                )
            azimuth_deg = estimate[0] if estimate else None
            _recommend_by_table(azimuth_deg, table, allowed, max_travel, placement, as_json=json)
            return
        if estimate is not None:
            raise UserError("--estimate and --distribution: give one of them")
        _recommend_by_distributions(
            distribution,
            table,
            rotations,
            allowed,
            max_travel,
            placement,
            until,
            followed=followed,
            as_json=json,
        )
        return
    if (object_id, candidates, sphere) != (None,) * 3:
        raise UserError("--object, --candidates and --sphere need --estimate and --table")
    if not frames:
        hint = "; give frames before --mask" if mask is not None else ""
        raise UserError(f"give a depth frame, or --estimate or --distribution with --table{hint}")
    if plot is not None:
        check_writable("--plot", plot, IMAGE_SUFFIXES)
    placement = _read_placement(camera_pose, axis)
    if gravity is not None and len(gravity) != 3:
        # Before frames are read, because text after the option is taken for a frame.
        noun = counted(len(gravity), "number")
        raise UserError(f"--gravity has {noun}; give three, the direction down: x,y,z")
    from nbv.robot.depth_files import read_depth, read_mask
    from nbv.robot.intrinsics import camera_of
    from nbv.robot.moves import check_axis, elevation_from_gravity
    from nbv.robot.recommender import Recommender

    if placement is not None and gravity is not None and elevation is None:
        # The axis gives the roll too, and the target pose needs the axis.
        elevation, gravity = elevation_from_gravity(gravity), None
    recommender = Recommender.load(bundle)
    cameras = [camera_of(intrinsics, path) for path in frames]
    answer = recommender.recommend(
        [
            read_depth(path, depth_scale, camera.unit_m)
            for path, camera in zip(frames, cameras, strict=True)
        ],
        rotations_deg=rotations if rotations is not None else [0.0],
        mask=None if mask is None else [read_mask(path) for path in mask],
        intrinsics=[camera.intrinsics for camera in cameras],
        near_m=near,
        far_m=far,
        elevation_deg=elevation,
        gravity=gravity,
        allowed_deg=allowed_rotations(allowed),
        max_travel_deg=max_travel,
        followed=followed,
        names=[str(path) for path in frames],
    )
    camera_warnings = dict.fromkeys(text for camera in cameras for text in camera.warnings)
    warnings = (*answer.warnings, *camera_warnings)
    if placement is not None:
        diagonal_m = recommender.bundle.diagonal_m
        warnings += check_axis(*placement, answer.object_position_m, diagonal_m)
    targets = target_poses((move.rotation_deg for move in answer.moves), placement)
    if plot is not None:
        # Importing matplotlib fails with an unknown backend.
        os.environ.pop("MPLBACKEND", None)
        from nbv.robot.plot import draw_recommendation

        draw_recommendation(answer, plot, recommender.bundle.category)
    focal_px = recommender.bundle.focal_px if intrinsics is None else None
    enough = None if until is None else answer.expected_error_deg <= until
    if json:
        print_json(recommendation_as_json(answer, warnings, targets, focal_px, enough))
        return
    if focal_px is not None:
        print_assumed_camera(focal_px)
    print_recommendation(answer, recommender.bundle.category, warnings, targets, enough)


def _read_placement(camera_pose: Path | None, axis: list[float] | None) -> Placement | None:
    if camera_pose is None and axis is None:
        return None
    if camera_pose is None or axis is None:
        raise UserError("--camera-pose and --axis belong together; give both, or neither")
    if len(axis) not in (3, 6):
        raise UserError(f"--axis has {len(axis)} numbers; give a point, or a point and a direction")
    from nbv.numbers import read_pose

    return read_pose(camera_pose), axis[:3], axis[3:] or [0.0, 0.0, 1.0]


def _recommend_by_table(
    estimate: float | None,
    table: Path | None,
    allowed: list[float] | Path | None,
    max_travel: float,
    placement: Placement | None,
    *,
    as_json: bool,
) -> None:
    """Print the next views of ``nbv recommend`` for an estimate and a lookup table."""
    if table is None or estimate is None:
        raise UserError(
            "--estimate and --table belong together; give both, or --distribution and --table"
        )
    from nbv.core.criteria import cost_unit
    from nbv.files import CALIBRATE_AGAIN, calibrated_file
    from nbv.robot.lookup import LookupTable
    from nbv.robot.moves import check_axis
    from nbv.robot.rotations import ranked_rotations

    path = calibrated_file(table)
    try:
        lookup = LookupTable.load(path)
    except UserError as error:
        # A robot's user has no run to start again.
        reason = str(error).removesuffix(f"; {CALIBRATE_AGAIN}")
        raise UserError(f"{reason}; give the .npz file that nbv calibrate wrote") from error
    unit = cost_unit(lookup.criterion, {"spread": lookup.spread})
    allowed_deg = allowed_rotations(allowed)
    ranked, warnings = ranked_rotations(lookup, estimate, allowed_deg, max_travel)
    warnings += () if placement is None else check_axis(*placement)
    targets = target_poses((rotation for rotation, _ in ranked), placement)
    if as_json:
        print_json(
            table_answer_as_json(estimate, lookup.criterion, unit, ranked, warnings, targets)
        )
        return
    unit = "" if unit == "1" else f" {unit}"
    (best, cost), *others = ranked
    print_line(
        f"turn the camera by {best:+g}°, travel {abs(best):g}° "
        f"({lookup.criterion} {cost:.3f}{unit})"
    )
    if others:
        listed = (f"{rotation:+g}° ({cost:.3f})" for rotation, cost in others)
        print_line(f"or {', '.join(listed)}")
    print_warnings(warnings)
    print_target(targets)


def _recommend_camera(
    estimate: list[float] | Path | None,
    table: Path | None,
    object_id: str | None,
    candidates: Path | None,
    sphere: int | None,
    camera_pose: Path | None,
    max_travel: float,
    until: float | None,
    *,
    as_json: bool,
) -> None:
    """Print the next camera poses of ``nbv recommend`` for rotations."""
    if table is None or estimate is None:
        raise UserError("--candidates and --sphere need --estimate and --table")
    if candidates is not None and sphere is not None:
        raise UserError("--candidates and --sphere: give one of them")
    from nbv.numbers import read_pose, read_poses
    from nbv.robot.next_camera import as_view, read_views
    from nbv.robot.rotation_pairs import OrientationTable

    views = (
        read_views(estimate) if isinstance(estimate, Path) else [as_view(estimate, "--estimate")]
    )
    answer = OrientationTable.load(table).recommend(
        views,
        read_poses(candidates) if candidates is not None else sphere or 0,
        object_id=object_id,
        camera_pose=None if camera_pose is None else read_pose(camera_pose),
        max_travel_deg=max_travel,
    )
    enough = None if until is None else answer.expected_error_deg <= until
    if as_json:
        print_json(camera_answer_as_json(answer, enough))
        return
    print_camera_answer(answer, enough)


def _recommend_by_distributions(
    distribution: Path,
    table: Path | None,
    rotations: list[float] | None,
    allowed: list[float] | Path | None,
    max_travel: float,
    placement: Placement | None,
    until: float | None,
    *,
    followed: bool,
    as_json: bool,
) -> None:
    """Print the answer of ``nbv recommend`` for distributions."""
    from nbv.robot.distribution_table import DistributionTable
    from nbv.robot.moves import check_axis
    from nbv.robot.pairs import read_distributions

    if table is None:
        raise UserError("--distribution and --table belong together; give both")
    answer = DistributionTable.load(table).recommend(
        read_distributions(distribution),
        rotations if rotations is not None else [0.0],
        allowed_deg=allowed_rotations(allowed),
        max_travel_deg=max_travel,
        followed=followed,
    )
    axis_warnings = () if placement is None else check_axis(*placement)
    warnings = (*answer.warnings, *axis_warnings)
    targets = target_poses((move.rotation_deg for move in answer.moves), placement)
    enough = None if until is None else answer.expected_error_deg <= until
    if as_json:
        print_json(recommendation_as_json(answer, warnings, targets, enough=enough))
        return
    print_recommendation(answer, "object", warnings, targets, enough)

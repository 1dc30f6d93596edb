"""The command ``nbv recommend``: the next view after depth frames."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from nbv.cli.answers import show_answer, with_targets
from nbv.cli.arguments import (
    SHIPPED,
    BundleName,
    Followed,
    Format,
    FrameOptions,
    Json,
    MoveOptions,
    Numbers,
    StopOptions,
    as_paragraphs,
    check_writable,
)
from nbv.errors import UserError
from nbv.labels import counted

IMAGE_SUFFIXES = (".png", ".pdf", ".svg")


@as_paragraphs
def recommend(
    *frames: Annotated[Path, Parameter(name="FRAME", negative=())],
    bundle: BundleName = SHIPPED,
    rotations: Numbers = None,
    camera: FrameOptions = FrameOptions(),
    mask: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative=())] = None,
    elevation: float | None = None,
    gravity: Numbers = None,
    limits: MoveOptions = MoveOptions(),
    followed: Followed = True,
    stop: StopOptions = StopOptions(),
    plot: Path | None = None,
    form: Format = None,
    json: Json = False,
) -> None:
    """Estimate the object's azimuth from depth frames and recommend the next view.

    Rotations are in degrees around the object's upright axis, counter-clockwise
    seen from above.

    Example: nbv recommend frame.png --intrinsics 585,585,319.5,239.5

    Example: nbv recommend a.npy b.npy --rotations 0 90 --plot answer.png

    Parameters
    ----------
    frames
        Depth frames of one object: .npy, .npz, or 16-bit images. Floating-point depth is in metres,
        integer depth in millimetres; see --depth-scale.
    rotations
        Rotation of each frame from the first one: 0 90, or 0,90, for two frames.
    mask
        Masks of the object, one for each frame. Give the frames before this option.
    elevation
        Elevation of the camera above the object's base plane, degrees.
    gravity
        Instead of the elevation: the direction down in the camera's optical frame, x,y,z (x right,
        y down, z forward). An accelerometer at rest reports the opposite direction.
    plot
        Draw crops, belief, expected errors and the move into this file: .png, .pdf or .svg.
    """
    if not frames:
        hint = "; give frames before --mask" if mask is not None else ""
        raise UserError(f"give a depth frame{hint}; nbv next takes estimates")
    if camera.mask_value is not None and mask is None:
        raise UserError("--mask-value goes with --mask; give the masks too, or leave it out")
    if plot is not None:
        check_writable("--plot", plot, IMAGE_SUFFIXES)
    placement = limits.placement()
    if gravity is not None and len(gravity) != 3:
        # Before frames are read, because text after the option is taken for a frame.
        noun = counted(len(gravity), "number")
        raise UserError(f"--gravity has {noun}; give three, the direction down: x,y,z")
    from nbv.bundles.recommender import Recommender
    from nbv.choice.moves import elevation_from_gravity
    from nbv.frames.depth_files import read_depth, read_mask
    from nbv.frames.intrinsics import camera_of

    if placement is not None and gravity is not None and elevation is None:
        # The axis gives the roll too, and the target pose needs the axis.
        elevation, gravity = elevation_from_gravity(gravity), None
    recommender = Recommender.load(bundle)
    cameras = [camera_of(camera.intrinsics, path) for path in frames]
    answer = recommender.recommend(
        [
            read_depth(path, camera.depth_scale, known.unit_m)
            for path, known in zip(frames, cameras, strict=True)
        ],
        rotations_deg=rotations if rotations is not None else [0.0],
        mask=None if mask is None else [read_mask(path, camera.mask_value) for path in mask],
        intrinsics=[known.intrinsics for known in cameras],
        near_m=camera.near,
        far_m=camera.far,
        elevation_deg=elevation,
        gravity=gravity,
        allowed_deg=limits.allowed_deg(),
        max_travel_deg=limits.max_travel,
        followed=followed,
        names=[str(path) for path in frames],
    )
    used = recommender.bundle
    camera_warnings = dict.fromkeys(text for known in cameras for text in known.warnings)
    answer = replace(answer, warnings=(*answer.warnings, *camera_warnings))
    answer = with_targets(answer, placement, answer.object_position_m, used.diagonal_m)
    if plot is not None:
        # Importing matplotlib fails with an unknown backend.
        os.environ.pop("MPLBACKEND", None)
        from nbv.bundles.plot import draw_recommendation

        draw_recommendation(answer, plot, used.category)
    show_answer(
        answer,
        stop,
        as_json=json,
        has_targets=placement is not None,
        seen=used.category,
        form=form,
        order=limits.quaternion or "xyzw",
        assumed_focal_px=used.focal_px if camera.intrinsics is None else None,
    )

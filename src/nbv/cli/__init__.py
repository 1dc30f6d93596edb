"""The command line: ``nbv recommend``, ``calibrate``, ``evaluate`` and the like.

Commands import what they use when they run, so that ``nbv --help`` stays quick.
"""

from __future__ import annotations

import errno
import io
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from cyclopts import App, CycloptsError, Parameter

from nbv import __version__
from nbv.cli.answers import (
    recommendation_as_json,
    say,
    say_assumed_camera,
    say_evaluation,
    say_json,
    say_names,
    say_offset,
    say_recommendation,
    say_warnings,
    target_poses,
)
from nbv.cli.arguments import (
    SHIPPED,
    FileAxis,
    Json,
    Numbers,
    Rotations,
    WholeNumber,
    WholeNumbers,
    allowed_rotations,
    as_paragraphs,
    check_writable,
    in_flags,
    joined_numbers,
)
from nbv.cli.own_estimator import calibrate_table, recommend_by_distributions, recommend_by_table
from nbv.errors import NamedError, UserError
from nbv.labels import counted

if TYPE_CHECKING:
    from nbv.cli.answers import Place
    from nbv.errors import FrameError
    from nbv.robot.network import Sweep
    from nbv.robot.recommender import Recommender

USER_ERROR = 2

ANY_TRAVEL_DEG = 180.0
UP, FRONT = "+z", "+x"

app = App(
    name="nbv",
    help=(
        "Where should the camera look next? Poses and next views from depth frames.\n\n"
        "A mistake in the input is one line, and exit code 2."
    ),
    version=__version__,
    help_format="plaintext",
    result_action="return_value",
)

FIGURES = (".png", ".pdf", ".svg")

# Where files are full, or the disk that they are on.
OF_FULL_OUTPUT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

# Products of small matrices on several threads wait for one another.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 2 after a line that says what the user can mend."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        app(joined_numbers(given), exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has seen enough.
        _drop_output()
    except (UserError, CycloptsError, OSError) as error:
        message = _message(error)
        # What cannot be printed is said in one line all the same.
        try:
            # An error of standard output itself names no file.
            can_print = not isinstance(error, OSError) or error.filename is not None
            if "--json" in given and can_print:
                name = error.name if isinstance(error, NamedError) else None
                say_json({"error": {"name": name, "message": message}})
            sys.stdout.flush()
        except OSError:
            _drop_output()
        return _refused(message)
    return 0


def _drop_output() -> None:
    """Lead standard output nowhere: the interpreter flushes it once more at its end, and fails."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _message(error: Exception) -> str:
    if not isinstance(error, OSError):
        return in_flags(" ".join(str(error).split()))
    reason = error.strerror or str(error)
    # Of a file to write: readers name the file themselves.
    if error.filename:
        return f"{error.filename}: {reason}"
    return f"standard output: {reason}" if error.errno in OF_FULL_OUTPUT else reason


def _refused(message: str) -> int:
    print(f"nbv: error: {message}", file=sys.stderr)  # noqa: T201
    return USER_ERROR


def run() -> NoReturn:
    """Run the command of the command line, and exit."""
    _open_streams()
    # Before numpy is imported, which reads them once.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    sys.exit(main())


def _open_streams() -> None:
    """Make the program's streams ready for every character, or exit where nothing can be said."""
    if sys.stderr is None:
        # Else the next file that is opened takes its number, and the messages of libraries.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stdout is None:
        sys.exit(_refused("standard output is closed: give it a file, or /dev/null"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


@app.command
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
    estimate: float | None = None,
    distribution: Path | None = None,
    table: Path | None = None,
    plot: Path | None = None,
    json: Json = False,
) -> None:
    """Estimate the object's azimuth and recommend the next view.

    Rotations are degrees about the object's upright axis, counter-clockwise
    seen from above.

    Example: nbv recommend frame.png --intrinsics 585,585,319.5,239.5

    Example: nbv recommend a.npy b.npy --rotations 0 90 --plot answer.png

    Parameters
    ----------
    frames
        Depth frames of one object: .npy or .npz, or images of 16 bits. Floating-point depth is in
        metres, integer depth in millimetres; see --depth-scale.
    bundle
        A bundle that comes with nbv, or a file.
    rotations
        Where each frame was taken, from the first frame's place: 0 90, or 0,90, for two frames.
    depth_scale
        Metres per unit of a frame's numbers. Default: 1 for floating-point depth; for integer depth
        what the camera file says, or 0.001.
    intrinsics
        fx,fy,cx,cy in pixels, the focal length alone, or a camera file (BOP, ROS CameraInfo). The
        focal length alone is for a frame that was cut out of a larger image.
    mask
        Masks of the object, one for each frame. The frames stand before this option.
    near
        The object lies beyond this, metres.
    far
        The object lies nearer than this, metres.
    elevation
        Degrees of the camera above the object's base plane, where it is known.
    gravity
        Instead of the elevation: the direction down in the camera's optical frame, x,y,z (x right,
        y down, z forward). An accelerometer at rest reports the opposite direction.
    allowed
        Rotations from the last frame that the camera may take: degrees, or a .npy file of degrees
        or of n booleans, where entry k is the rotation 360 k / n.
    max_travel
        Degrees that the camera may travel.
    followed
        Whether a recommendation chose the last of several views. The expected error is then raised,
        because the same errors chose the view. Give --not-followed for a turntable or fixed
        cameras.
    camera_pose
        The camera's pose at the last view, and then the target pose is given too: that of the
        optical frame (x right, y down, z forward) in the base frame, metres; the 16 numbers of a
        4 x 4 matrix, row by row, in a .txt, .npy or .json file.
    axis
        The object's upright axis in the base frame: a point, metres, or a point and a direction,
        which is 0 0 1 without it.
    estimate
        Instead of frames: the azimuth that your own estimator gave, degrees.
    distribution
        Instead of frames: a file of the distributions that your own estimator gave, a row for each
        view. CSV with columns p0, p1, ..., or .npy.
    table
        The lookup table that nbv calibrate made of that estimator.
    plot
        Draw crop, belief, expected errors and the move into this file: .png, .pdf or .svg.
    json
        Print JSON.
    """
    if (table, estimate, distribution) != (None, None, None):
        of_frames: dict[str, object] = {
            "FRAME": frames or None,
            "--bundle": None if bundle == SHIPPED else bundle,
        }
        of_frames |= {"--plot": plot, "--mask": mask, "--near": near, "--far": far}
        of_frames |= {"--intrinsics": intrinsics, "--depth-scale": depth_scale}
        of_frames |= {"--elevation": elevation, "--gravity": gravity}
        if distribution is None:
            of_frames["--rotations"] = rotations
            of_frames["--not-followed"] = None if followed else True
        if ignored := [name for name, value in of_frames.items() if value is not None]:
            own = "--estimate" if distribution is None else "--distribution"
            raise UserError(f"{ignored[0]} does not go with {own} and --table; leave it out")
        place = _known_place(camera_pose, axis)
        if distribution is None:
            recommend_by_table(estimate, table, allowed, max_travel, place, as_json=json)
            return
        if estimate is not None:
            raise UserError("--estimate and --distribution: give one of them")
        recommend_by_distributions(
            distribution,
            table,
            rotations,
            allowed,
            max_travel,
            place,
            followed=followed,
            as_json=json,
        )
        return
    if not frames:
        hint = "; frames stand before --mask" if mask is not None else ""
        raise UserError(f"give a depth frame, or --estimate or --distribution with --table{hint}")
    if plot is not None:
        check_writable("--plot", plot, FIGURES)
    place = _known_place(camera_pose, axis)
    if gravity is not None and len(gravity) != 3:
        # Before frames are read: what is not a number after the option is taken for one.
        noun = counted(len(gravity), "number")
        raise UserError(f"--gravity has {noun}; give three, the direction down: x,y,z")
    from nbv.robot.depth_files import read_depth, read_mask
    from nbv.robot.intrinsics import camera_of
    from nbv.robot.moves import check_axis, elevation_from_gravity
    from nbv.robot.recommender import Recommender

    if place is not None and gravity is not None and elevation is None:
        # The axis tells of a roll too, and is the one that the target pose needs.
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
    warnings = answer.warnings
    if place is not None:
        diagonal_m = recommender.bundle.diagonal_m
        warnings += check_axis(*place, answer.object_position_m, diagonal_m)
    targets = target_poses((move.rotation_deg for move in answer.moves), place)
    if plot is not None:
        # An unknown one ends the import of matplotlib.
        os.environ.pop("MPLBACKEND", None)
        from nbv.robot.plot import draw_recommendation

        draw_recommendation(answer, plot, recommender.bundle.category)
    focal_px = recommender.bundle.focal_px if intrinsics is None else None
    if json:
        say_json(recommendation_as_json(answer, warnings, targets, focal_px))
        return
    if focal_px is not None:
        say_assumed_camera(focal_px)
    say_recommendation(answer, recommender.bundle.category, warnings, targets)


@app.command
@as_paragraphs
def calibrate(
    source: Annotated[Path, Parameter(name="PAIRS_OR_MANIFEST")],
    /,
    *,
    output: Path,
    bundle: str | None = None,
    criterion: str | None = None,
    intrinsics: str | None = None,
    depth_scale: float | None = None,
    near: float | None = None,
    far: float | None = None,
    json: Json = False,
) -> None:
    """Calibrate an estimator's error model from ground-truth azimuths.

    From pairs (object_id, azimuth_deg, estimate_deg) of any estimator it makes
    a lookup table for nbv recommend --estimate; with columns p0, p1, ..., the
    probabilities of the azimuths 360 k / B, also what nbv recommend
    --distribution needs. From a manifest of frames (object_id, sequence, file,
    azimuth_deg) and a bundle it makes the bundle for your camera.

    Example: nbv calibrate pairs.csv --output table.npz

    Example: nbv calibrate manifest.csv --bundle mug --output my.safetensors

    Parameters
    ----------
    source
        A CSV file of pairs or of frames.
    output
        The file to write: .npz for a table, .safetensors for a bundle.
    bundle
        The bundle whose network sees the frames.
    criterion
        Of the lookup table: pose_ambiguity (without this option), information_gain,
        expected_dispersion, bayes_error, expected_error or fixed.
    intrinsics
        Of frames: fx,fy,cx,cy in pixels, the focal length alone, or a camera file.
    depth_scale
        Metres per unit of a frame's numbers. Default: 1 for floating-point depth; for integer depth
        what the camera file says, or 0.001.
    near
        The object lies beyond this, metres.
    far
        The object lies nearer than this, metres.
    json
        Print JSON.
    """
    if bundle is None:
        of_frames = {"--intrinsics": intrinsics, "--depth-scale": depth_scale}
        of_frames |= {"--near": near, "--far": far}
        if ignored := [name for name, value in of_frames.items() if value is not None]:
            raise UserError(f"{ignored[0]} is for frames, which need --bundle: --bundle mug")
        if output.suffix.lower() == ".safetensors":
            raise UserError(
                f"--output={output} is a bundle, and frames make one with --bundle: add "
                "--bundle mug; pairs make a table, an .npz file"
            )
        check_writable("--output", output, [".npz"])
        calibrate_table(source, output, criterion or "pose_ambiguity", as_json=json)
        return
    if criterion is not None:
        raise UserError("--criterion is for pairs, which need no --bundle; leave one of them out")
    check_writable("--output", output, [".safetensors"])
    from nbv.core.distributions import mean_direction_deg
    from nbv.core.logits import from_logits
    from nbv.core.offset import FOR_FRAMES, Offset, frame_warning
    from nbv.robot.calibration import recalibrated

    seen = _seen_frames(bundle, source, intrinsics, depth_scale, near, far, as_json=json)
    held, turns = seen.recommender.bundle, seen.turns
    if seen.n_assumed and not json:
        say_assumed_camera(held.focal_px, seen.n_assumed)
    recordings: list[dict[str, Any]] = []
    for turn in turns:
        estimate_deg = mean_direction_deg(from_logits(turn.logits, held.temperature))
        offset = Offset.of(turn.azimuth_deg, estimate_deg, FOR_FRAMES)
        is_added = not frame_warning(turn.azimuth_deg, estimate_deg)
        about = {"object_id": turn.object_id, "sequence": turn.sequence}
        counts = {"n_frames": len(estimate_deg)}
        recordings.append(about | counts | asdict(offset) | {"is_added": is_added})
        if not json:
            # Before the tables are made, which takes up to a minute.
            name = f"{turn.object_id}, sequence {turn.sequence}"
            say_offset(name, counted(len(estimate_deg), "frame"), offset, is_added=is_added)
    sys.stdout.flush()
    recalibrated(held, turns, str(source)).save(output)
    if json:
        say_json(
            {
                "file": str(output),
                "category": held.category,
                "n_objects": len({turn.object_id for turn in turns}),
                "recordings": recordings,
                **seen.as_json(),
            }
        )
        return
    say(f"{output}: {held.category}, calibrated on {counted(len(turns), 'recording')}")


@app.command
@as_paragraphs
def evaluate(
    manifest: Annotated[Path, Parameter(name="MANIFEST")],
    /,
    *,
    bundle: str = SHIPPED,
    views: WholeNumbers = None,
    intrinsics: str | None = None,
    depth_scale: float | None = None,
    near: float | None = None,
    far: float | None = None,
    output: Path | None = None,
    json: Json = False,
) -> None:
    """Measure errors on frames with known azimuths, for every way to choose views.

    Example: nbv evaluate manifest.csv --views 2 3

    Parameters
    ----------
    manifest
        CSV with object_id, sequence, file, azimuth_deg; if known mask, elevation_deg, fx, fy, cx,
        cy.
    bundle
        A bundle that comes with nbv, or a file.
    views
        Numbers of views; 2 3 4 5 without it.
    intrinsics
        fx,fy,cx,cy in pixels, the focal length alone, or a camera file.
    depth_scale
        Metres per unit of a frame's numbers. Default: 1 for floating-point depth; for integer depth
        what the camera file says, or 0.001.
    near
        The object lies beyond this, metres.
    far
        The object lies nearer than this, metres.
    output
        Write the table as CSV too.
    json
        Print JSON.
    """
    if output is not None:
        check_writable("--output", output, [".csv"])
    from nbv.files import write_csv
    from nbv.robot.evaluation import count_ood
    from nbv.robot.evaluation import evaluate as evaluate_

    seen = _seen_frames(bundle, manifest, intrinsics, depth_scale, near, far, as_json=json)
    held, turns = seen.recommender.bundle, seen.turns

    def tell(n_done: int) -> None:
        if len(turns) > 1:
            print(f"evaluated {n_done} of {len(turns)} recordings", file=sys.stderr)  # noqa: T201

    found = evaluate_(held, turns, views or [2, 3, 4, 5], report=tell)
    if output is not None:
        write_csv(output, found)
    familiar = count_ood(held, turns)
    calibrated_by = sorted({turn.object_id for turn in turns} & set(held.object_ids))
    if json:
        say_json(
            {
                "errors": found.to_dict("records"),
                "calibrated_by": calibrated_by,
                "ood": [
                    about | {"warning": about["warning"] or None}
                    for about in familiar.to_dict("records")
                ],
                **seen.as_json(),
            }
        )
        return
    if seen.n_assumed:
        say_assumed_camera(held.focal_px, seen.n_assumed)
    if calibrated_by:
        say_warnings(
            [
                f"{', '.join(calibrated_by)}: the bundle was calibrated with this name; errors on "
                "what calibrated it are too low, so evaluate other objects"
            ]
        )
    say_evaluation(found, familiar)


@app.command
@as_paragraphs
def render(
    mesh: Annotated[Path | None, Parameter(name="MESH")] = None,
    /,
    *,
    output: Path,
    example: Annotated[bool, Parameter(negative=())] = False,
    azimuth: float = 75.0,
    elevation: float = 15.0,
    distance: float = 0.8,
    diagonal: float = 0.17,
    up: FileAxis = UP,
    front: FileAxis = FRONT,
    sensor: str = "kinect",
    seed: WholeNumber = 0,
    json: Json = False,
) -> None:
    """Write the depth frame that a depth camera would take of a mesh.

    The camera is the first Kinect: 640 x 480 pixels, a focal length of 585 px.
    With --sensor stereo it is a RealSense D435: 848 x 480 pixels, 424 px. It is
    directed at the object.

    Example: nbv render mug.obj --up +y --front -z --output frame.npy

    Parameters
    ----------
    mesh
        A mesh file: .obj, .ply, .off, .stl or .glb.
    output
        The file to write: .npy in metres, or .png in millimetres (16 bits).
    example
        A generated mug instead of a mesh file.
    azimuth
        Of the camera about the object, degrees.
    elevation
        Of the camera, degrees.
    distance
        From the camera to the object, metres.
    diagonal
        Of the object's bounding box, metres.
    up
        The axis of the mesh file that points up: +x, -x, +y, -y, +z or -z.
    front
        The axis of the mesh file that points to the front.
    sensor
        kinect, stereo, or none: the true depth in the Kinect's image.
    seed
        Of the sensor's noise: another one gives other noise.
    json
        Print JSON.
    """
    if (mesh is None) != example:
        raise UserError("give a mesh file, or --example")
    if example and (up, front) != (UP, FRONT):
        raise UserError("--up and --front are of a mesh file; leave them out with --example")
    check_writable("--output", output, [".npy", ".png"])
    from nbv.robot.depth_files import write_depth
    from nbv.robot.synthetic import draw_frame, example_mesh, read_mesh

    shape = example_mesh() if mesh is None else read_mesh(mesh, up, front)
    frame = draw_frame(shape, azimuth, elevation, distance, diagonal, seed, sensor=sensor)
    write_depth(output, frame.depth_m)
    camera, n_pixels = frame.intrinsics, int(frame.mask.sum())
    if json:
        about = {"file": str(output), "intrinsics": asdict(camera), "object_pixels": n_pixels}
        say_json(about)
        return
    say(
        f"{output}: {n_pixels} pixels of the object; "
        f"--intrinsics {camera.fx:g},{camera.fy:g},{camera.cx:g},{camera.cy:g}"
    )


@app.command
@as_paragraphs
def inspect(bundle: str = SHIPPED, /, *, json: Json = False) -> None:
    """Show what a bundle holds and where it comes from.

    Example: nbv inspect mug

    Parameters
    ----------
    bundle
        A bundle that comes with nbv, or a file.
    json
        Print JSON.
    """
    from nbv.robot.bundle import FORMAT, Bundle
    from nbv.robot.recommender import bundle_path

    path = bundle_path(bundle)
    held = Bundle.load(path)
    about: dict[str, Any] = {
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": FORMAT,
        "category": held.category,
        "diagonal_m": held.diagonal_m,
        "extent_m": list(held.extent_m),
        "focal_px": held.focal_px,
        "crop": f"{held.camera.image_side} pixels, {held.camera.fov_deg:g}°",
        "classes": held.n_bins,
        "network": dict(held.estimator),
        "mirror_plane_deg": held.mirror_plane_deg,
        "temperature": round(held.temperature, 3),
        "affinity": dict(held.affinity),
        "familiar_within": held.ood.threshold,
        "calibration_objects": len(set(held.object_ids)),
        "calibration_turns": len(held.object_ids),
        "elevations_deg": sorted(
            {round(float(e), 1) for e in held.elevation_deg if not math.isnan(e)}
        ),
        **held.provenance,
    }
    if json:
        say_json(about)
    else:
        say_names(about)


@app.command
@as_paragraphs
def export(bundle: str = SHIPPED, /, *, onnx: Path, json: Json = False) -> None:
    """Write a bundle's network, an ONNX model from crops to logits.

    Example: nbv export mug --onnx mug.onnx

    Parameters
    ----------
    bundle
        A bundle that comes with nbv, or a file.
    onnx
        The file to write.
    json
        Print JSON.
    """
    check_writable("--onnx", onnx, [".onnx"])
    from nbv.files import replacing
    from nbv.robot.bundle import Bundle
    from nbv.robot.network import open_session
    from nbv.robot.recommender import bundle_path

    model = Bundle.load(bundle_path(bundle)).network
    session = open_session(model)
    with replacing(onnx) as temporary:
        temporary.write_bytes(model)
    if json:
        about: dict[str, Any] = {"file": str(onnx)}
        for end in (*session.get_inputs(), *session.get_outputs()):
            # n is any number.
            about[end.name] = end.shape
        say_json(about)
        return
    say(f"{onnx}: codes (n, 1, side, side) to logits (n, classes) and hidden layer")


@dataclass(frozen=True)
class SeenFrames:
    """What a bundle makes of recordings; the focal length of `n_assumed` frames is assumed."""

    recommender: Recommender
    turns: list[Sweep]
    n_assumed: int
    left_out: dict[str, FrameError]

    def as_json(self) -> dict[str, Any]:
        """Return for JSON whose camera is assumed, and which frames are left out."""
        return {
            "assumed_focal_px": self.recommender.bundle.focal_px if self.n_assumed else None,
            "n_frames_without_camera": self.n_assumed,
            "left_out": [
                {"file": path, "reason": error.name, "message": in_flags(error.message)}
                for path, error in self.left_out.items()
            ],
        }


def _seen_frames(
    bundle: str,
    manifest: Path,
    intrinsics: str | None,
    depth_scale: float | None,
    near: float | None,
    far: float | None,
    *,
    as_json: bool,
) -> SeenFrames:
    """Return what a bundle makes of the frames of a manifest, and tell which are left out."""
    from nbv.robot.recommender import Recommender
    from nbv.robot.recordings import read_manifest, run_network

    left_out: dict[str, FrameError] = {}

    def tell(path: str, error: FrameError) -> None:
        left_out[path] = error
        line = f"skipping {path}: {in_flags(str(error))}"
        print(line, file=sys.stderr) if as_json else say(line)  # noqa: T201

    recommender, recordings = Recommender.load(bundle), read_manifest(manifest)
    turns = [
        run_network(recommender, one, intrinsics, depth_scale, tell, near, far)
        for one in recordings
    ]
    n_assumed = sum(
        camera is None and intrinsics is None and path not in left_out
        for one in recordings
        for path, camera in zip(one.frames["path"], one.intrinsics, strict=True)
    )
    return SeenFrames(recommender, turns, n_assumed, left_out)


def _known_place(camera_pose: Path | None, axis: list[float] | None) -> Place | None:
    if camera_pose is None and axis is None:
        return None
    if camera_pose is None or axis is None:
        raise UserError("--camera-pose and --axis belong together")
    if len(axis) not in (3, 6):
        raise UserError(f"--axis has {len(axis)} numbers; give a point, or a point and a direction")
    from nbv.robot.moves import read_pose

    return read_pose(camera_pose), axis[:3], axis[3:] or [0.0, 0.0, 1.0]

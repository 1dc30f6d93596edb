"""The command line: ``nbv recommend``, ``calibrate``, ``evaluate`` and the like.

Commands import what they use when they run, so that ``nbv --help`` stays quick.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from cyclopts import App, CycloptsError, Parameter

from nbv import __version__
from nbv.cli.answers import (
    recommendation_as_json,
    say,
    say_evaluation,
    say_json,
    say_names,
    say_recommendation,
)
from nbv.cli.arguments import (
    Numbers,
    Rotations,
    WholeNumbers,
    joined_numbers,
    need_writable,
)
from nbv.errors import UserError
from nbv.labels import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nbv.bundles.recommender import Recommender
    from nbv.bundles.turns import Turn

USER_ERROR = 2

app = App(
    name="nbv",
    help="Where should the camera look next? Poses and next views from depth frames.",
    version=__version__,
    help_format="plaintext",
    result_action="return_value",
)

FIGURES = (".png", ".pdf", ".svg")

# Products of small matrices on several threads wait for one another.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 2 after a line that says what the user can mend."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        app(joined_numbers(given), exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has seen enough. The interpreter flushes once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        # Of a file to write: readers name the file themselves.
        where = f"{error.filename}: " if error.filename else ""
        return _refused(f"{where}{error.strerror}")
    except (UserError, CycloptsError) as error:
        return _refused(" ".join(str(error).split()))
    return 0


def _refused(message: str) -> int:
    print(f"nbv: error: {message}", file=sys.stderr)  # noqa: T201
    return USER_ERROR


def run() -> NoReturn:
    """Run the command of the command line, and exit."""
    # Before numpy is imported, which reads them once.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    sys.exit(main())


@app.command
def recommend(
    *frames: Annotated[Path, Parameter(name="FRAME", negative=())],
    bundle: str = "mug",
    rotations: Numbers = None,
    depth_scale: float | None = None,
    intrinsics: str | None = None,
    mask: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative=())] = None,
    near: float | None = None,
    far: float | None = None,
    elevation: float | None = None,
    allowed: Rotations = None,
    max_travel: float = 180.0,
    camera_pose: Path | None = None,
    axis: Numbers = None,
    estimate: float | None = None,
    table: Path | None = None,
    plot: Path | None = None,
    json: bool = False,
) -> None:
    """Say where the camera stands about the object, and where it should look next.

    Rotations are degrees about the object's upright axis, counter-clockwise seen from above.

    Parameters
    ----------
    frames
        Depth frames of one object: .npy or .npz in metres, or 16-bit images.
    bundle
        A bundle that comes with nbv, or a file.
    rotations
        Where each frame was taken, from the first frame's place: 0 90, or 0,90, for two frames.
    depth_scale
        Metres per unit of whole numbers; 0.001 without it.
    intrinsics
        fx,fy,cx,cy in pixels, or a camera file (BOP, ROS CameraInfo).
    mask
        Masks of the object, one for each frame. The frames stand before this option.
    near
        The object lies beyond this, metres.
    far
        The object lies nearer than this, metres.
    elevation
        Degrees of the camera above the object's base plane, where it is known.
    allowed
        Rotations from the last frame that the camera may take: degrees, or a .npy file of degrees
        or of n booleans, where entry k is the rotation 360 k / n.
    max_travel
        Degrees that the camera may travel.
    camera_pose
        A file with the camera's pose in the base frame, 4 x 4: the target pose is then given too.
    axis
        The object's upright axis in the base frame: a point, or a point and a direction.
    estimate
        Instead of frames: the azimuth that your own estimator gave, degrees.
    table
        The lookup table that nbv calibrate made of that estimator.
    plot
        Draw crop, belief and expected errors into this file.
    json
        Print JSON.
    """
    if table is not None or estimate is not None:
        of_frames: dict[str, object] = {
            "FRAME": frames or None,
            "--allowed": allowed,
            "--axis": axis,
        }
        of_frames |= {"--plot": plot}
        of_frames |= {"--camera-pose": camera_pose, "--mask": mask, "--rotations": rotations}
        of_frames |= {"--intrinsics": intrinsics, "--depth-scale": depth_scale, "--near": near}
        of_frames |= {"--far": far, "--elevation": elevation}
        if ignored := [name for name, value in of_frames.items() if value is not None]:
            raise UserError(f"{ignored[0]} does not go with --estimate and --table; leave it out")
        _recommend_by_table(estimate, table, as_json=json)
        return
    if not frames:
        hint = "; frames stand before --mask" if mask is not None else ""
        raise UserError(f"give a depth frame, or --estimate with --table{hint}")
    if plot is not None:
        need_writable("--plot", plot, FIGURES)
    place = _known_place(camera_pose, axis)
    from nbv.bundles.moves import moved_camera, read_rotations
    from nbv.bundles.recommender import Recommender
    from nbv.frames.depth_files import read_depth, read_mask
    from nbv.frames.intrinsics import camera_of

    may_take = read_rotations(allowed) if isinstance(allowed, Path) else allowed
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
        allowed_deg=may_take,
        max_travel_deg=max_travel,
    )
    target = None if place is None else moved_camera(*place, answer.move.rotation_deg)
    if plot is not None:
        from nbv.reporting.recommendation import draw_recommendation

        draw_recommendation(answer, plot, recommender.bundle.category)
    if json:
        say_json(recommendation_as_json(answer, target))
    else:
        say_recommendation(answer, recommender.bundle, intrinsics is not None, target)


@app.command
def calibrate(
    source: Annotated[Path, Parameter(name="PAIRS_OR_MANIFEST")],
    /,
    *,
    output: Path,
    bundle: str | None = None,
    criterion: str | None = None,
    intrinsics: str | None = None,
    depth_scale: float | None = None,
) -> None:
    """Learn from known azimuths what an estimator's errors are.

    From pairs (object_id, azimuth_deg, estimate_deg) of any estimator it makes a lookup table for
    nbv recommend --estimate. From a manifest of frames (object_id, sequence, file, azimuth_deg) and
    a bundle it makes the bundle for your camera.

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
        expected_dispersion or expected_error.
    intrinsics
        fx,fy,cx,cy in pixels, or a camera file, for frames.
    depth_scale
        Metres per unit of whole numbers; 0.001 without it.
    """
    if bundle is None:
        of_frames = {"--intrinsics": intrinsics, "--depth-scale": depth_scale}
        if ignored := [name for name, value in of_frames.items() if value is not None]:
            raise UserError(f"{ignored[0]} is for frames, which need --bundle: --bundle mug")
        if output.suffix.lower() == ".safetensors":
            raise UserError(
                f"--output={output} is a bundle, and frames make one with --bundle: add "
                "--bundle mug; pairs make a table, an .npz file"
            )
        need_writable("--output", output, [".npz"])
        _calibrate_table(source, output, criterion or "pose_ambiguity")
        return
    if criterion is not None:
        raise UserError("--criterion is for pairs, which need no --bundle; leave one of them out")
    need_writable("--output", output, [".safetensors"])
    from nbv.bundles.beliefs import distributions_of
    from nbv.bundles.bundle import save_bundle
    from nbv.bundles.calibration import recalibrated
    from nbv.recommendation.belief import mean_direction_deg

    recommender, turns = _seen_turns(bundle, source, intrinsics, depth_scale, say)
    calibrated = recalibrated(recommender.bundle, turns, str(source))
    for turn in turns:
        seen = distributions_of(turn.logits, recommender.bundle.temperature)
        estimate_deg = mean_direction_deg(seen)
        name = f"{turn.object_id}, sequence {turn.sequence}"
        _say_offset(name, counted(len(estimate_deg), "frame"), turn.azimuth_deg, estimate_deg)
    save_bundle(output, calibrated)
    calibrate_it = "recording calibrates it" if len(turns) == 1 else "recordings calibrate it"
    say(f"{output}: {recommender.bundle.category}, {len(turns)} {calibrate_it}")


@app.command
def evaluate(
    manifest: Annotated[Path, Parameter(name="MANIFEST")],
    /,
    *,
    bundle: str = "mug",
    views: WholeNumbers = None,
    intrinsics: str | None = None,
    depth_scale: float | None = None,
    output: Path | None = None,
    json: bool = False,
) -> None:
    """Measure errors on frames with known azimuths, for every way to choose views.

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
        fx,fy,cx,cy in pixels, or a camera file.
    depth_scale
        Metres per unit of whole numbers; 0.001 without it.
    output
        Write the table as CSV too.
    json
        Print JSON.
    """
    if output is not None:
        need_writable("--output", output, [".csv"])
    from nbv.bundles.evaluation import evaluate as evaluate_
    from nbv.bundles.evaluation import familiarity_of
    from nbv.files import write_csv

    tell = (lambda line: print(line, file=sys.stderr)) if json else say  # noqa: T201
    recommender, turns = _seen_turns(bundle, manifest, intrinsics, depth_scale, tell)
    found = evaluate_(recommender.bundle, turns, views or [2, 3, 4, 5])
    if output is not None:
        write_csv(output, found)
    familiar = familiarity_of(recommender.bundle, turns)
    if json:
        say_json({"errors": found.to_dict("records"), "familiarity": familiar.to_dict("records")})
    else:
        say_evaluation(found, familiar)


@app.command
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
    up: str = "+z",
    front: str = "+x",
    noise: bool = True,
) -> None:
    """Write the depth frame that a depth camera would take of a mesh.

    Parameters
    ----------
    mesh
        A mesh file: .obj, .ply, .off, .stl or .glb.
    output
        The .npy file to write, in metres.
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
        The axis of the file that points up.
    front
        The axis of the file that points to the front.
    noise
        Whether the sensor's noise is there.
    """
    if (mesh is None) != example:
        raise UserError("give a mesh file, or --example")
    need_writable("--output", output, [".npy"])
    import numpy as np

    from nbv.files import replacing
    from nbv.frames.drawn import draw_frame, example_mesh, read_mesh

    shape = example_mesh() if mesh is None else read_mesh(mesh, up, front)
    frame = draw_frame(shape, azimuth, elevation, distance, diagonal, noise=noise)
    with replacing(output) as temporary:
        np.save(temporary, frame.depth_m)
    camera = frame.intrinsics
    say(
        f"{output}: {frame.mask.sum()} pixels of the object; "
        f"--intrinsics {camera.fx:g},{camera.fy:g},{camera.cx:g},{camera.cy:g}"
    )


@app.command
def inspect(bundle: str = "mug", /, *, json: bool = False) -> None:
    """Show what a bundle holds and where it comes from.

    Parameters
    ----------
    bundle
        A bundle that comes with nbv, or a file.
    json
        Print JSON.
    """
    from nbv.bundles.bundle import load_bundle
    from nbv.bundles.recommender import bundle_path

    path = bundle_path(bundle)
    held = load_bundle(path)
    about: dict[str, Any] = {
        "file": str(path),
        "bytes": path.stat().st_size,
        "category": held.category,
        "diagonal_m": held.diagonal_m,
        "focal_px": held.focal_px,
        "crop": f"{held.camera.image_side} pixels, {held.camera.fov_deg:g}°",
        "classes": held.n_bins,
        "temperature": round(held.temperature, 3),
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
def export(bundle: str = "mug", /, *, onnx: Path) -> None:
    """Write a bundle's network as ONNX: from crops to logits.

    Parameters
    ----------
    bundle
        A bundle that comes with nbv, or a file.
    onnx
        The file to write.
    """
    need_writable("--onnx", onnx, [".onnx"])
    from nbv.bundles.bundle import load_bundle
    from nbv.bundles.onnx_graph import onnx_model
    from nbv.bundles.recommender import bundle_path
    from nbv.files import replacing

    model = onnx_model(load_bundle(bundle_path(bundle)))
    with replacing(onnx) as temporary:
        temporary.write_bytes(model.SerializeToString())
    say(f"{onnx}: codes (n, 1, side, side) to logits")


def _calibrate_table(source: Path, output: Path, criterion: str) -> None:
    import numpy as np

    from nbv.bundles.calibration import DENSITY
    from nbv.calibration.pairs import read_pairs
    from nbv.errors import nearest
    from nbv.recommendation.criteria import CRITERIA
    from nbv.recommendation.density_selection import chosen_lookup
    from nbv.recommendation.lookup import save_lookup

    if criterion not in CRITERIA:
        raise UserError(f"--criterion={criterion}: {nearest(criterion, CRITERIA)}")
    estimates = read_pairs(source).estimate_deg
    azimuth_deg = np.broadcast_to(np.arange(estimates.shape[1], dtype=np.float64), estimates.shape)
    save_lookup(output, chosen_lookup(estimates, criterion, DENSITY))
    _say_offset(str(source), counted(len(estimates), "object"), azimuth_deg, estimates)
    say(f"{output}: {criterion} from {counted(len(estimates), 'object')}")


def _say_offset(
    name: str, number: str, azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]
) -> None:
    from nbv.calibration.offset import constant_offset_deg, offset_warning

    say(f"{name}: {number}; offset {constant_offset_deg(estimate_deg - azimuth_deg):+.1f}°")
    if warning := offset_warning(azimuth_deg, estimate_deg):
        say(f"careful    {warning}")


def _seen_turns(
    bundle: str,
    manifest: Path,
    intrinsics: str | None,
    depth_scale: float | None,
    tell: Callable[[str], None],
) -> tuple[Recommender, list[Turn]]:
    from nbv.bundles.manifest import read_manifest, see
    from nbv.bundles.recommender import Recommender

    recommender, recordings = Recommender.load(bundle), read_manifest(manifest)
    return recommender, [see(recommender, one, intrinsics, depth_scale, tell) for one in recordings]


def _recommend_by_table(estimate: float | None, table: Path | None, *, as_json: bool) -> None:
    if table is None or estimate is None:
        raise UserError("--estimate and --table belong together")
    if not math.isfinite(estimate):
        raise UserError(f"--estimate={estimate:g}: give an azimuth in degrees")
    from nbv.angles import nearest_bin, travel_deg
    from nbv.recommendation.lookup import load_lookup

    if not table.exists():
        raise UserError(f"{table} does not exist; name the file that nbv calibrate wrote")
    try:
        lookup = load_lookup(table)
    except UserError as error:
        raise UserError(
            f"--table={table}: no lookup table; give the .npz file that nbv calibrate wrote"
        ) from error
    rotation = int(lookup.recommend(estimate))
    cost = float(
        lookup.cost[
            nearest_bin(estimate, len(lookup.cost)), nearest_bin(rotation, len(lookup.cost))
        ]
    )
    about = {
        "estimate_deg": estimate,
        "rotation_deg": rotation if rotation <= 180 else rotation - 360,
        "travel_deg": float(travel_deg(rotation)),
        "criterion": lookup.criterion,
        "cost": cost,
    }
    if as_json:
        say_json(about)
        return
    say(
        f"turn the camera by {about['rotation_deg']:+d}°, travel {about['travel_deg']:g}° "
        f"({lookup.criterion} {cost:.3f})"
    )


def _known_place(
    camera_pose: Path | None, axis: list[float] | None
) -> tuple[NDArray[np.float64], list[float], list[float]] | None:
    """Return the camera's pose, and a point and the direction of the object's axis."""
    if camera_pose is None and axis is None:
        return None
    if camera_pose is None or axis is None:
        raise UserError("--camera-pose and --axis belong together")
    if len(axis) not in (3, 6):
        raise UserError(f"--axis has {len(axis)} numbers; give a point, or a point and a direction")
    from nbv.bundles.moves import read_pose

    return read_pose(camera_pose), axis[:3], axis[3:] or [0.0, 0.0, 1.0]

"""The command line: ``nbv recommend``, ``calibrate``, ``evaluate`` and the like.

Commands import what they use when they run, so that ``nbv --help`` stays quick.
"""

from __future__ import annotations

import json as json_
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from cyclopts import App, CycloptsError, Parameter

from nbv import __version__
from nbv.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from nbv.bundles.manifest import Recording
    from nbv.bundles.recommender import Recommendation, Recommender
    from nbv.frames.intrinsics import Intrinsics

USER_ERROR = 2

app = App(
    name="nbv",
    help="Where should the camera look next? Poses and next views from depth frames.",
    version=__version__,
    help_format="plaintext",
    result_action="return_value",
)

Numbers = Annotated[list[float] | None, Parameter(consume_multiple=True)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 2 after a line that says what the user can mend."""
    try:
        app(
            list(sys.argv[1:] if arguments is None else arguments),
            exit_on_error=False,
            print_error=False,
        )
    except OSError as error:
        # Of a file to write: readers name the file themselves.
        where = f"{error.filename}: " if error.filename else ""
        print(f"nbv: error: {where}{error.strerror}", file=sys.stderr)  # noqa: T201
        return USER_ERROR
    except (UserError, CycloptsError) as error:
        message = " ".join(str(error).split())
        print(f"nbv: error: {message}", file=sys.stderr)  # noqa: T201
        return USER_ERROR
    return 0


def run() -> NoReturn:
    """Run the command of the command line, and exit."""
    sys.exit(main())


@app.command
def recommend(
    frames: Annotated[list[Path] | None, Parameter(name="FRAME")] = None,
    /,
    *,
    bundle: str = "mug",
    rotations: Numbers = None,
    depth_scale: float | None = None,
    intrinsics: str | None = None,
    mask: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    near: float | None = None,
    far: float | None = None,
    elevation: float | None = None,
    allowed: Numbers = None,
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
        Where each frame was taken, from the first frame's place: 0 90 for two frames.
    depth_scale
        Metres per unit of whole numbers; 0.001 without it.
    intrinsics
        fx,fy,cx,cy in pixels, or a camera file (BOP, ROS CameraInfo).
    mask
        Masks of the object, one for each frame.
    near
        The object lies beyond this, metres.
    far
        The object lies nearer than this, metres.
    elevation
        Degrees of the camera above the object's base plane, where it is known.
    allowed
        Rotations from the last frame that the camera may take.
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
        of_frames = {"FRAME": frames, "--allowed": allowed, "--axis": axis, "--plot": plot}
        of_frames |= {"--camera-pose": camera_pose, "--mask": mask, "--rotations": rotations}
        if ignored := [name for name, value in of_frames.items() if value is not None]:
            raise UserError(f"{ignored[0]} does not go with --estimate and --table; leave it out")
        _recommend_by_table(estimate, table, as_json=json)
        return
    if not frames:
        raise UserError("give a depth frame, or --estimate with --table")
    from nbv.bundles.recommender import Recommender
    from nbv.frames.depth_files import read_depth, read_mask

    recommender = Recommender.load(bundle)
    answer = recommender.recommend(
        [read_depth(path, depth_scale) for path in frames],
        rotations_deg=rotations if rotations is not None else [0.0],
        mask=None if mask is None else [read_mask(path) for path in mask],
        intrinsics=_camera(intrinsics),
        near_m=near,
        far_m=far,
        elevation_deg=elevation,
        allowed_deg=allowed,
        max_travel_deg=max_travel,
    )
    target = _target_pose(answer, camera_pose, axis)
    if json:
        _print_json(_answer_as_json(answer, target))
    else:
        _print_answer(answer, recommender, len(frames), intrinsics is None, target)
    if plot is not None:
        from nbv.reporting.recommendation import draw_recommendation

        draw_recommendation(answer, plot, recommender.bundle.category)


@app.command
def calibrate(
    source: Annotated[Path, Parameter(name="PAIRS_OR_MANIFEST")],
    /,
    *,
    output: Path,
    bundle: str | None = None,
    criterion: str = "pose_ambiguity",
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
        Of the lookup table: pose_ambiguity, information_gain, expected_dispersion or
        expected_error.
    intrinsics
        fx,fy,cx,cy in pixels, or a camera file, for frames.
    depth_scale
        Metres per unit of whole numbers; 0.001 without it.
    """
    if bundle is None:
        from nbv.bundles.calibration import DENSITY
        from nbv.calibration.pairs import read_pairs
        from nbv.errors import nearest
        from nbv.recommendation.criteria import CRITERIA
        from nbv.recommendation.density_selection import chosen_lookup
        from nbv.recommendation.lookup import save_lookup

        if output.suffix != ".npz":
            raise UserError(f"--output={output}: a lookup table is an .npz file")
        if criterion not in CRITERIA:
            raise UserError(f"--criterion={criterion}: {nearest(criterion, CRITERIA)}")
        estimates = read_pairs(source).estimate_deg
        save_lookup(output, chosen_lookup(estimates, criterion, DENSITY))
        _print(f"{output}: {criterion} from {len(estimates)} objects")
        return
    from nbv.bundles.bundle import save_bundle
    from nbv.bundles.calibration import recalibrated
    from nbv.bundles.manifest import see

    recommender, recordings = _opened(bundle, source)
    camera = _camera(intrinsics)
    turns = [see(recommender, one, camera, depth_scale, _print) for one in recordings]
    save_bundle(output, recalibrated(recommender.bundle, turns, str(source)))
    _print(f"{output}: {recommender.bundle.category}, {len(turns)} recordings calibrate it")


@app.command
def evaluate(
    manifest: Annotated[Path, Parameter(name="MANIFEST")],
    /,
    *,
    bundle: str = "mug",
    views: Annotated[list[int] | None, Parameter(consume_multiple=True)] = None,
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
    from nbv.bundles.evaluation import evaluate as evaluate_
    from nbv.bundles.evaluation import familiarity_of
    from nbv.bundles.manifest import see
    from nbv.files import write_csv

    recommender, recordings = _opened(bundle, manifest)
    tell = (lambda line: print(line, file=sys.stderr)) if json else _print  # noqa: T201
    camera = _camera(intrinsics)
    turns = [see(recommender, one, camera, depth_scale, tell) for one in recordings]
    found = evaluate_(recommender.bundle, turns, views or [2, 3, 4, 5])
    if output is not None:
        write_csv(output, found)
    familiar = familiarity_of(recommender.bundle, turns)
    if json:
        _print_json(
            {"errors": found.to_dict("records"), "familiarity": familiar.to_dict("records")}
        )
    else:
        _print_evaluation(found, familiar)


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
    import numpy as np

    from nbv.files import replacing
    from nbv.frames.drawn import draw_frame, example_mesh, read_mesh

    shape = example_mesh() if mesh is None else read_mesh(mesh, up, front)
    frame = draw_frame(shape, azimuth, elevation, distance, diagonal, noise=noise)
    if output.suffix != ".npy":
        raise UserError(f"--output={output}: give a name that ends in .npy")
    with replacing(output) as temporary:
        np.save(temporary, frame.depth_m)
    camera = frame.intrinsics
    _print(
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
        _print_json(about)
        return
    width = max(map(len, about))
    for name, value in about.items():
        _print(f"{name:<{width}}  {value}")


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
    from nbv.bundles.bundle import load_bundle
    from nbv.bundles.onnx_graph import onnx_model
    from nbv.bundles.recommender import bundle_path
    from nbv.files import replacing

    model = onnx_model(load_bundle(bundle_path(bundle)))
    with replacing(onnx) as temporary:
        temporary.write_bytes(model.SerializeToString())
    _print(f"{onnx}: codes (n, 1, side, side) to logits")


def _camera(intrinsics: str | None) -> Intrinsics | None:
    from nbv.frames.intrinsics import parse_intrinsics

    return None if intrinsics is None else parse_intrinsics(intrinsics)


def _opened(bundle: str, manifest: Path) -> tuple[Recommender, list[Recording]]:
    from nbv.bundles.manifest import read_manifest
    from nbv.bundles.recommender import Recommender

    return Recommender.load(bundle), read_manifest(manifest)


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
        _print_json(about)
        return
    _print(
        f"turn the camera by {about['rotation_deg']:+d}°, travel {about['travel_deg']:g}° "
        f"({lookup.criterion} {cost:.3f})"
    )


def _target_pose(
    answer: Recommendation, camera_pose: Path | None, axis: list[float] | None
) -> NDArray[np.float64] | None:
    if camera_pose is None and axis is None:
        return None
    if camera_pose is None or axis is None:
        raise UserError("--camera-pose and --axis belong together")
    if len(axis) not in (3, 6):
        raise UserError(f"--axis has {len(axis)} numbers; give a point, or a point and a direction")
    from nbv.bundles.moves import moved_camera, read_pose

    direction = axis[3:] or [0.0, 0.0, 1.0]
    return moved_camera(read_pose(camera_pose), axis[:3], direction, answer.move.rotation_deg)


def _answer_as_json(answer: Recommendation, target: NDArray[np.float64] | None) -> dict[str, Any]:
    def move(one: Any) -> dict[str, float]:
        return {
            "rotation_deg": one.rotation_deg,
            "travel_deg": one.travel_deg,
            "expected_error_deg": one.expected_error_deg,
        }

    about: dict[str, Any] = {
        "azimuth_deg": answer.azimuth_deg,
        "spread_deg": answer.spread_deg,
        "expected_error_deg": answer.expected_error_deg,
        "move": move(answer.move),
        "alternatives": [move(one) for one in answer.alternatives],
        "unfamiliarity": answer.unfamiliarity,
        "belief": answer.belief.tolist(),
        "error_after_deg": [None if e == float("inf") else e for e in answer.error_after_deg],
    }
    if target is not None:
        about["target_camera_pose"] = target.tolist()
    return about


def _print_answer(
    answer: Recommendation,
    recommender: Recommender,
    n_frames: int,
    assumed: bool,
    target: NDArray[np.float64] | None,
) -> None:
    bundle, move = recommender.bundle, answer.move
    if assumed:
        _print(f"camera     not given: a focal length of {bundle.focal_px:g} px is assumed")
    _print(
        f"pose       azimuth {answer.azimuth_deg:.1f}° about the {bundle.category}; "
        f"expected error {answer.expected_error_deg:.1f}°, spread {answer.spread_deg:.1f}° "
        f"({n_frames} {'view' if n_frames == 1 else 'views'})"
    )
    _print(
        f"next view  turn by {move.rotation_deg:+.0f}° (travel {move.travel_deg:.0f}°): "
        f"expected error {move.expected_error_deg:.1f}°"
    )
    if answer.alternatives:
        others = (
            f"{m.rotation_deg:+.0f}° ({m.expected_error_deg:.1f}°)" for m in answer.alternatives
        )
        _print(f"or         {', '.join(others)}")
    if answer.is_unfamiliar:
        _print(
            f"careful    a frame is like nothing that was calibrated "
            f"({answer.unfamiliarity:.1f} times the limit): check mask, units and category"
        )
    if target is not None:
        _print("target camera pose in the base frame")
        for row in target:
            _print("  " + " ".join(f"{value:9.5f}" for value in row))


def _print_evaluation(found: pd.DataFrame, familiar: pd.DataFrame) -> None:
    for about in familiar.to_dict("records"):
        is_own = (found["object_id"] == about["object_id"]) & (
            found["sequence"] == about["sequence"]
        )
        rows = found[is_own]
        _print(
            f"{about['object_id']}, sequence {about['sequence']}: {about['n_frames']} frames; "
            f"offset {rows['offset_deg'].iloc[0]:+.1f}°; {about['n_unfamiliar']} unfamiliar, "
            f"{about['n_wrong']} wrong by more than 45°, {about['n_wrong_unfamiliar']} both"
        )
        numbers = sorted(rows["n_views"].unique())
        _print(f"  {'MAE (without offset), degrees':<30}" + "".join(f"{n:>15}" for n in numbers))
        for choice in dict.fromkeys(rows["choice"]):
            of_choice = rows[rows["choice"] == choice].set_index("n_views")
            cells = (
                f"{of_choice['mae_deg'][n]:.1f} ({of_choice['mae_without_offset_deg'][n]:.1f})"
                if n in of_choice.index
                else ""
                for n in numbers
            )
            _print(f"  {choice:<30}" + "".join(f"{cell:>15}" for cell in cells))


def _print(line: str) -> None:
    print(line)  # noqa: T201


def _print_json(value: Any) -> None:
    _print(json_.dumps(value, indent=2, ensure_ascii=False))

"""Commands for bundles and meshes: inspect, export and render."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from nbv.cli.answers import print_json, print_line, print_names
from nbv.cli.arguments import (
    SHIPPED,
    BundleName,
    FileAxis,
    Json,
    WholeNumber,
    as_paragraphs,
    check_writable,
)
from nbv.errors import UserError

UP, FRONT = "+z", "+x"


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
    """Render the depth frame that a depth camera would take of a mesh.

    The camera is the first Kinect: 640 x 480 pixels, a focal length of 585 px.
    With --sensor stereo it is a RealSense D435: 848 x 480 pixels, 424 px. It
    points at the object.

    Example: nbv render mug.obj --up +y --front -z --output frame.npy

    Parameters
    ----------
    mesh
        A mesh file: .obj, .ply, .off, .stl or .glb.
    output
        The file to write: .npy in metres, or .png in millimetres (16 bits).
    example
        Use a procedural mug instead of a mesh file.
    azimuth
        Azimuth of the camera around the object, degrees.
    elevation
        Elevation of the camera, degrees.
    distance
        Distance of the camera from the object, metres.
    diagonal
        Diagonal of the object's bounding box, metres.
    up
        Axis of the mesh file that points up: +x, -x, +y, -y, +z or -z.
    front
        Axis of the mesh file that points to the front.
    sensor
        kinect, stereo, or none for the true depth in the Kinect's image.
    seed
        Seed of the sensor's noise.
    """
    if (mesh is None) != example:
        raise UserError("give a mesh file, or --example")
    if example and (up, front) != (UP, FRONT):
        raise UserError("--up and --front are for a mesh file; leave them out with --example")
    check_writable("--output", output, [".npy", ".png"])
    from nbv.frames.depth_files import write_depth
    from nbv.frames.synthetic import draw_frame, example_mesh, read_mesh

    shape = example_mesh() if mesh is None else read_mesh(mesh, up, front)
    frame = draw_frame(shape, azimuth, elevation, distance, diagonal, seed, sensor=sensor)
    write_depth(output, frame.depth_m)
    camera, n_pixels = frame.intrinsics, int(frame.mask.sum())
    if json:
        known = {name: value for name, value in asdict(camera).items() if value is not None}
        about = {"file": str(output), "intrinsics": known, "object_pixels": n_pixels}
        print_json(about)
        return
    print_line(
        f"{output}: {n_pixels} pixels of the object; "
        f"--intrinsics {camera.fx:g},{camera.fy:g},{camera.cx:g},{camera.cy:g}"
    )


@as_paragraphs
def inspect(bundle: BundleName = SHIPPED, /, *, json: Json = False) -> None:
    """Show how good a bundle is, its content and its provenance.

    Example: nbv inspect mug
    """
    from nbv.bundles.bundle import FORMAT, Bundle
    from nbv.bundles.evaluation import bundle_errors_deg
    from nbv.bundles.recommender import bundle_path

    path = bundle_path(bundle)
    content = Bundle.load(path)
    errors_deg = bundle_errors_deg(content)
    about: dict[str, Any] = {
        "calibration_error_deg": {name: round(error, 1) for name, error in errors_deg.items()},
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": FORMAT,
        "category": content.category,
        "diagonal_m": content.diagonal_m,
        "extent_m": list(content.extent_m),
        "focal_px": content.focal_px,
        "crop": f"{content.camera.image_side} pixels, {content.camera.fov_deg:g}°",
        "classes": content.n_bins,
        "network": dict(content.estimator),
        "mirror_plane_deg": content.mirror_plane_deg,
        "temperature": round(content.temperature, 3),
        "affinity": dict(content.affinity),
        "ood_threshold": content.ood.threshold,
        "calibration_objects": len(set(content.object_ids)),
        "calibration_sweeps": len(content.object_ids),
        "elevations_deg": sorted(
            {round(float(e), 1) for e in content.elevation_deg if not math.isnan(e)}
        ),
        **content.provenance,
    }
    (print_json if json else print_names)(about)


@as_paragraphs
def export(bundle: BundleName = SHIPPED, /, *, onnx: Path, json: Json = False) -> None:
    """Write a bundle's network as an ONNX model from crops to logits.

    Example: nbv export mug --onnx mug.onnx

    Parameters
    ----------
    onnx
        The file to write.
    """
    check_writable("--onnx", onnx, [".onnx"])
    from nbv.bundles.bundle import Bundle
    from nbv.bundles.network import open_session
    from nbv.bundles.recommender import bundle_path
    from nbv.files import replacing

    model = Bundle.load(bundle_path(bundle)).network
    session = open_session(model)
    with replacing(onnx) as temporary:
        temporary.write_bytes(model)
    if json:
        # In shapes, n is any number.
        ends = (*session.get_inputs(), *session.get_outputs())
        print_json({"file": str(onnx)} | {end.name: end.shape for end in ends})
        return
    print_line(f"{onnx}: codes (n, 1, side, side) to logits (n, classes) and hidden layer")

"""The commands ``nbv calibrate`` and ``nbv evaluate``: known azimuths of frames or estimates."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from nbv.cli.answers import (
    print_assumed_camera,
    print_evaluation,
    print_json,
    print_line,
    print_offset,
    print_warnings,
)
from nbv.cli.arguments import (
    AZIMUTHS,
    FRAMES,
    ORIENTATIONS,
    SHIPPED,
    BundleName,
    FrameOptions,
    Json,
    WholeNumbers,
    as_paragraphs,
    check_options,
    check_writable,
    in_flags,
)
from nbv.errors import by_number
from nbv.labels import counted

if TYPE_CHECKING:
    import pandas as pd

    from nbv.bundles.network import Sweep
    from nbv.bundles.recommender import Recommender
    from nbv.bundles.recordings import Recording
    from nbv.errors import FrameError


OPTIONS = {
    AZIMUTHS: ("criterion",),
    ORIENTATIONS: ("ground_truth", "models_info", "object", "nearest", "least_score"),
    FRAMES: ("bundle", "intrinsics", "depth_scale", "near", "far"),
}
"""Options for some files only."""


@as_paragraphs
@Parameter(name="*")
@dataclass(frozen=True)
class CalibrationOptions:
    """Options that depend on what the file holds.

    Parameters
    ----------
    criterion
        Criterion of the lookup table of azimuths: pose_ambiguity (default), information_gain,
        expected_dispersion, bayes_error, expected_error or fixed.
    ground_truth
        The truth of BOP's results: the folder that has the scenes' scene_gt.json, or a CSV file in
        the form of results. Default: the folder of the results. The truth of a folder of poses: a
        folder of poses with the same names.
    models_info
        For orientations: BOP's models_info.json, which gives the objects' symmetries.
    object
        Keep this object of a file of orientations; give the option again for more. Default: all.
        For a folder of poses: the object's name. Default: the folder's name.
    nearest
        An estimate of BOP, or of a folder, that is farther from every instance of its object,
        millimetres, is left out. Default: 50.
    least_score
        Leave out estimates of lower scores.
    bundle
        The bundle to calibrate on frames: the name of a shipped one (default: mug), or a file.
    """

    criterion: str | None = None
    ground_truth: Path | None = None
    models_info: Path | None = None
    object: Annotated[list[str] | None, Parameter(negative=())] = None
    nearest: float | None = None
    least_score: float | None = None
    bundle: str | None = None
    camera: FrameOptions = FrameOptions()


@as_paragraphs
def calibrate(
    source: Annotated[Path, Parameter(name="PAIRS_OR_MANIFEST")],
    /,
    *,
    output: Path,
    options: CalibrationOptions = CalibrationOptions(),
    json: Json = False,
) -> None:
    """Calibrate an estimator's error model from ground truth, as the file's columns say.

    From pairs (object_id, azimuth_deg, estimate_deg) of any estimator it makes
    a table for nbv next. With columns p0, p1, ..., the probabilities of the
    azimuths 360 k / B, the table also serves distributions. From orientations,
    BOP's results or pairs (object_id, R_true, R_estimate), it makes a table for
    camera poses, and so it does from a folder with an estimated pose per frame,
    whose truths are in the folder --ground-truth. From a manifest of frames
    (object_id, sequence, file, azimuth_deg) it makes a bundle for your camera.

    Example: nbv calibrate pairs.csv --output table.npz

    Example: nbv calibrate manifest.csv --bundle mug --output my.safetensors

    Parameters
    ----------
    source
        A CSV file of pairs or of frames, or a folder of poses.
    output
        The file to write: .npz for a table, .safetensors for a bundle.
    """
    from nbv.files import read_rows

    rows = None if source.is_dir() else read_rows(source, ())
    kind = _kind(rows)
    given = vars(options) | {"camera": None} | vars(options.camera)
    check_options(given, OPTIONS[kind], f"{source}, which holds {kind}")
    check_writable("--output", output, [".safetensors" if kind == FRAMES else ".npz"])
    CALIBRATIONS[kind](source, rows, output, options, json)


def _kind(rows: pd.DataFrame | None) -> str:
    """Return what a file with the columns of these rows holds, or a folder, which has none."""
    if rows is None or "R_true" in rows or ("obj_id" in rows and "R" in rows):
        return ORIENTATIONS
    return FRAMES if "file" in rows and "estimate_deg" not in rows else AZIMUTHS


def _calibrate_bundle(
    source: Path, rows: pd.DataFrame, output: Path, options: CalibrationOptions, as_json: bool
) -> None:
    """Make a bundle from the rows of a manifest."""
    from nbv.bundles.calibration import recalibrated
    from nbv.bundles.recordings import recordings_of
    from nbv.core.circle.distributions import mean_direction_deg
    from nbv.core.circle.logits import from_logits
    from nbv.core.circle.offset import FOR_FRAMES, Offset, frame_warning

    of_rows = recordings_of(source, rows)
    run = _run_on_recordings(options.bundle or SHIPPED, of_rows, options.camera, as_json=as_json)
    used, sweeps = run.recommender.bundle, run.sweeps
    recordings: list[dict[str, Any]] = []
    for sweep in sweeps:
        estimate_deg = mean_direction_deg(from_logits(sweep.logits, used.temperature))
        offset = Offset.of(sweep.azimuth_deg, estimate_deg, FOR_FRAMES)
        is_added = not frame_warning(sweep.azimuth_deg, estimate_deg)
        about = {"object_id": sweep.object_id, "sequence": sweep.sequence}
        counts = {"n_frames": len(estimate_deg)}
        recordings.append(about | counts | asdict(offset) | {"is_added": is_added})
        if not as_json:
            # Before making the tables, which takes up to a minute.
            name = f"{sweep.object_id}, sequence {sweep.sequence}"
            print_offset(name, counted(len(estimate_deg), "frame"), offset, is_added=is_added)
    sys.stdout.flush()
    recalibrated(used, sweeps, str(source)).save(output)
    n_objects = len({sweep.object_id for sweep in sweeps})
    if as_json:
        made = {"file": str(output), "category": used.category, "n_objects": n_objects}
        print_json(made | {"recordings": recordings} | run.as_json())
        return
    print_line(f"{output}: {used.category}, calibrated on {counted(len(sweeps), 'recording')}")


@as_paragraphs
def evaluate(
    manifest: Annotated[Path, Parameter(name="MANIFEST")],
    /,
    *,
    bundle: BundleName = SHIPPED,
    views: WholeNumbers = None,
    until: float | None = None,
    camera: FrameOptions = FrameOptions(),
    output: Path | None = None,
    json: Json = False,
) -> None:
    """Evaluate every way to choose views on frames with known azimuths.

    Example: nbv evaluate manifest.csv --views 2 3

    Parameters
    ----------
    manifest
        CSV with object_id, sequence, file, azimuth_deg, and optionally mask, elevation_deg, fx, fy,
        cx, cy.
    views
        Numbers of views. Default: 2 3 4 5.
    until
        Also stop as soon as the expected error is at most this, degrees, or after the largest
        number of views.
    output
        Also write the errors to this CSV file.
    """
    if output is not None:
        check_writable("--output", output, [".csv"])
    from nbv.bundles import evaluation
    from nbv.bundles.recordings import read_manifest
    from nbv.files import write_csv

    run = _run_on_recordings(bundle, read_manifest(manifest), camera, as_json=json)
    used, sweeps = run.recommender.bundle, run.sweeps

    def report(n_done: int) -> None:
        if len(sweeps) > 1:
            print(f"evaluated {n_done} of {len(sweeps)} recordings", file=sys.stderr)  # noqa: T201

    numbers = views or [2, 3, 4, 5]
    errors = evaluation.evaluate(used, sweeps, numbers, until_deg=until, report=report)
    if output is not None:
        write_csv(output, errors)
    ood = evaluation.count_ood(used, sweeps)
    calibrated_by = sorted({sweep.object_id for sweep in sweeps} & set(used.object_ids))
    if json:
        rows = errors.astype(object).where(errors.notna(), None).to_dict("records")
        warned = [row | {"warning": row["warning"] or None} for row in ood.to_dict("records")]
        about = {"errors": rows, "calibrated_by": calibrated_by, "ood": warned}
        print_json(about | run.as_json())
        return
    if calibrated_by:
        print_warnings(
            [
                f"{', '.join(calibrated_by)}: the bundle was calibrated on an object of this name, "
                "so its errors are too low; evaluate other objects"
            ]
        )
    print_evaluation(errors, ood)


def _calibrate_table(
    source: Path, rows: pd.DataFrame, output: Path, options: CalibrationOptions, as_json: bool
) -> None:
    """Make the tables of azimuths, and of distributions if there are some."""
    import numpy as np

    from nbv.core.choose import named
    from nbv.core.circle.criteria import CRITERIA
    from nbv.core.circle.distributions import mean_direction_deg
    from nbv.core.circle.offset import FOR_PAIRS, Offset
    from nbv.core.circle.selection import DENSITY, chosen_lookup
    from nbv.tables.distribution_table import DistributionTable
    from nbv.tables.lookup import LookupTable
    from nbv.tables.pairs import PairTable

    criterion = options.criterion or "pose_ambiguity"
    named("criterion", criterion, CRITERIA)
    pairs = PairTable.from_rows(source, rows)
    sweeps = pairs.distributions
    views, thin = (pairs.estimates, ()) if sweeps else pairs.thin_estimates
    thin = (*pairs.repeated, *thin)
    estimates = views.estimate_deg
    table = DistributionTable.from_pairs(sweeps) if sweeps else None
    lookup = LookupTable.of(chosen_lookup(estimates, criterion, DENSITY))
    if table is None:
        lookup.save(output)
    else:
        table.save(output, lookup)
    offset, number = pairs.offset, counted(len(estimates), "object")
    about = {"file": str(output), "criterion": criterion, "n_objects": len(estimates)}
    about |= asdict(offset) | {"thin": list(thin)}
    if not as_json:
        print_offset(str(source), number, offset)
        print_warnings(thin)
        print_line(f"{output}: {criterion} from {number}")
    if table is not None:
        azimuth_deg, of_views = map(np.concatenate, zip(*sweeps.values(), strict=True))
        offset = Offset.of(azimuth_deg, mean_direction_deg(of_views), FOR_PAIRS)
        offset = replace(offset, warning=offset.warning or table.warning or None)
        about["distributions"] = {"temperature": table.temperature} | asdict(offset)
        if not as_json:
            classes = f"{table.n_classes} classes, temperature {table.temperature:.2f}"
            print_offset("distributions", classes, offset)
    if as_json:
        print_json(about)


def _calibrate_orientations(
    source: Path, rows: Any, output: Path, options: CalibrationOptions, as_json: bool
) -> None:
    """Make the table of estimates in three dimensions."""
    from nbv.tables.bop import read_orientation_table
    from nbv.tables.pose_folders import read_pose_folders
    from nbv.tables.walks import NO_FORECAST, forecast

    truth = options.ground_truth, options.models_info, options.object or []
    read = read_pose_folders if rows is None else partial(read_orientation_table, rows=rows)
    pairs = read(source, *truth, options.nearest, options.least_score)
    about = pairs.about()
    pairs.save(output)
    if not as_json:
        print_warnings(pairs.left_out)
        for summary in sorted(about, key=lambda summary: by_number(summary.object_id)):
            depends = "flips depend" if summary.depends_on_view else "no evidence that flips depend"
            print_line(
                f"object {summary.object_id}: {counted(summary.n_pairs, 'pair')} "
                f"of {counted(summary.n_groups, 'instance')}, "
                f"{summary.directions_covered:.0%} of directions covered; "
                f"error {summary.mean_error_deg:.1f}°, {counted(summary.n_flips, 'flip')}; "
                f"{depends} on the view"
            )
            if summary.holds_where is not None:
                print_line(f"  {summary.holds_where}")
            print_warnings(summary.warnings)
        print_line(f"{output}: {counted(len(pairs.object_id), 'pair')}")
        sys.stdout.flush()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    if (expected := forecast(pairs)) is not None:
        replace(pairs, bounds_deg=expected.bounds_deg).save(output)
    if as_json:
        objects = [asdict(summary) for summary in about]
        made = {"file": str(output), "objects": objects, "left_out": list(pairs.left_out)}
        print_json(made | {"forecast": expected and asdict(expected)})
        return
    print_line(NO_FORECAST if expected is None else expected.sentence)


CALIBRATIONS: Mapping[str, Callable[..., None]] = {
    AZIMUTHS: _calibrate_table,
    ORIENTATIONS: _calibrate_orientations,
    FRAMES: _calibrate_bundle,
}
"""What makes a table or a bundle of each kind of file."""


@dataclass(frozen=True)
class ManifestRun:
    """A bundle's predictions for a manifest, and the frames that were skipped.

    The focal length of `n_assumed` frames is assumed.
    """

    recommender: Recommender
    sweeps: list[Sweep]
    n_assumed: int
    left_out: dict[str, FrameError]

    def as_json(self) -> dict[str, Any]:
        """Return the assumed focal length and the skipped frames for JSON."""
        return {
            "assumed_focal_px": self.recommender.bundle.focal_px if self.n_assumed else None,
            "n_frames_without_camera": self.n_assumed,
            "left_out": [
                {"file": path, "reason": error.name, "message": in_flags(error.message)}
                for path, error in self.left_out.items()
            ],
        }


def _run_on_recordings(
    bundle: str, recordings: Sequence[Recording], camera: FrameOptions, *, as_json: bool
) -> ManifestRun:
    """Run a bundle's network on recordings; print skipped frames and an assumed camera."""
    from nbv.bundles.recommender import Recommender
    from nbv.bundles.recordings import run_network

    left_out: dict[str, FrameError] = {}

    def report(path: str, error: FrameError) -> None:
        left_out[path] = error
        say(f"skipping {path}: {error}")

    def say(message: str) -> None:
        line = in_flags(message)
        print(line, file=sys.stderr) if as_json else print_line(line)  # noqa: T201

    recommender = Recommender.load(bundle)
    limits = camera.near, camera.far, camera.mask_value
    options = camera.intrinsics, camera.depth_scale, report, *limits
    sweeps = [run_network(recommender, recording, *options) for recording in recordings]
    for sweep in sweeps:
        for warning in sweep.warnings:
            say(f"warning: {warning}")
    n_assumed = sum(
        known is None and camera.intrinsics is None and path not in left_out
        for recording in recordings
        for path, known in zip(recording.frames["path"], recording.intrinsics, strict=True)
    )
    if n_assumed and not as_json:
        print_assumed_camera(recommender.bundle.focal_px, n_assumed)
    return ManifestRun(recommender, sweeps, n_assumed, left_out)

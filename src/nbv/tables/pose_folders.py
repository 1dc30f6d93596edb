"""Calibration pairs in two folders with a pose for each frame, as FoundationPose writes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.errors import UserError
from nbv.numbers import Array
from nbv.poses import IN_JSON, GivenPose, as_given, read_entries
from nbv.tables.bop import nearest_or_default, read_orientation_table
from nbv.tables.orientation_table import OrientationTable


def read_pose_folders(
    folder: Path,
    truth: Path | None,
    models_info: Path | None = None,
    objects: Sequence[str] = (),
    nearest_mm: float | None = None,
    least_score: float | None = None,
) -> OrientationTable:
    """Read the estimated and the true pose of each frame from files of the same name.

    The frames of a subfolder are a scene. The object is `objects`, by default the folder's name;
    other parameters are those of `nbv.tables.bop.read_orientation_table`. A UserError names the
    file.
    """
    if truth is not None and not truth.is_dir():
        raise UserError(f"`ground_truth`={truth} is no folder; give a folder of poses")
    if truth is None or len(objects) > 1 or (models_info and not objects):
        raise UserError(
            f"{folder} is a folder: give `ground_truth`, a folder with the true pose of each frame "
            "in a file of the same name, and with `models_info` the name of its `object`"
        )
    if least_score is not None:
        raise UserError(f"{folder}: poses in a folder have no scores; leave `least_score` out")
    nearest_mm = nearest_or_default(nearest_mm)
    estimates, truths = _files(folder), _files(truth)
    both = [name for name in estimates if name in truths]
    rows, warnings = [], dict[str, None]()
    for name in both:
        pose, true = _pose(estimates[name]), _pose(truths[name])
        if true is None:
            raise UserError(f"{truths[name]} holds no pose; give the true one, or leave it out")
        row = {"object_id": objects[0] if objects else folder.resolve().name}
        row |= {"scene_id": name.parent.as_posix(), "R_true": _text(true.rotation)}
        row["R_estimate"] = "nan" if pose is None else _text(pose.rotation)
        at, position = None if pose is None else pose.position_mm, true.position_mm
        if position is not None:
            row["t_true_mm"] = _text(position)
        if position is None or at is None or np.linalg.norm(at - position) <= nearest_mm:
            rows.append(row)
        warnings |= dict.fromkeys(text for each in (pose, true) if each for text in each.warnings)
    if not rows:
        raise UserError(
            f"{folder}: none of {len(estimates)} poses has a true one of the same name in {truth} "
            f"within {nearest_mm:g} mm: are both of the same frames, and object to camera?"
        )
    table = pd.DataFrame(rows).dropna(axis=1)
    pairs = read_orientation_table(folder, None, models_info, objects, rows=table)
    counts = (
        (len(both), len(rows), f"estimates are farther than {nearest_mm:g} mm from the truth"),
        (len(estimates), len(both), f"estimates have no truth in {truth}"),
        (len(truths), len(both), "truths have no estimate"),
    )
    told = [f"{of - used} of {of} {what}" for of, used, what in counts if of > used]
    return replace(pairs, left_out=(*told, *warnings, *pairs.left_out))


def _files(folder: Path) -> dict[Path, Path]:
    """Return the files of poses below a folder by their path in it, without the suffix."""
    kinds = (".txt", ".npy", ".json", ".yaml", ".yml")
    files = [file for file in sorted(folder.rglob("*")) if file.suffix.lower() in kinds]
    return {file.relative_to(folder).with_suffix(""): file for file in files}


def _pose(file: Path) -> GivenPose | None:
    """Return the pose in a file; None for what estimators write for no pose."""
    if not file.stat().st_size:
        return None
    (name, given), *others = read_entries(file, "")
    if others:
        raise UserError(f"{file} holds {1 + len(others)} poses; give one for each frame")
    if isinstance(given, np.ndarray) and given.size == 7:
        raise UserError(f"{file} has 7 numbers: give a 4 × 4 matrix, or {IN_JSON}")
    if isinstance(given, np.ndarray) and (
        np.isnan(given).any() or not given.any() or np.array_equal(given, np.eye(4).ravel())
    ):
        return None
    return as_given(given, name)


def _text(numbers: Array) -> str:
    return " ".join(map(repr, numbers.ravel().tolist()))

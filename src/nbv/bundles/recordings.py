"""Recordings: frames of objects on a turntable, with known azimuths."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from nbv.bundles.network import Sweep
from nbv.bundles.recommender import Recommender
from nbv.core.circle.angles import MOST_DEG
from nbv.errors import FrameError, UserError
from nbv.files import missing, need_columns, read_rows
from nbv.frames.depth_files import read_depth, read_mask
from nbv.frames.intrinsics import Intrinsics, camera_of
from nbv.labels import counted
from nbv.numbers import column

REQUIRED = ("object_id", "sequence", "file", "azimuth_deg")
OPTIONAL = ("mask", "elevation_deg", "fx", "fy", "cx", "cy")

_LIMITS = {"azimuth_deg": MOST_DEG, "elevation_deg": 90.0}

# Similarity of a misspelt optional column: one letter of elevation_deg, but not its unit.
_SIMILARITY = 0.9


@dataclass(frozen=True)
class Recording:
    """Frames of one object, taken from one camera height, and the intrinsics of each.

    The frames have ``path, azimuth_deg`` and, where the manifest has them, ``mask, elevation_deg``,
    in the order of the manifest.
    """

    object_id: str
    sequence: str
    frames: pd.DataFrame
    intrinsics: tuple[Intrinsics | None, ...]

    @property
    def azimuth_deg(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """True azimuth of each frame, degrees."""
        return self.frames["azimuth_deg"].to_numpy(dtype=np.float64)

    @property
    def elevation_deg(self) -> float:
        """Mean elevation of the frames, degrees; NaN if the manifest has none."""
        if "elevation_deg" not in self.frames:
            return float("nan")
        return float(self.frames["elevation_deg"].mean())


def read_manifest(path: str | Path) -> list[Recording]:
    """Read a manifest: a CSV file with the columns `REQUIRED`, and any of `OPTIONAL`.

    File names are relative to the manifest's folder. Azimuths are degrees, counter-clockwise around
    the object seen from above. Raise UserError where a column or a file is missing, a file occurs
    twice in a sequence, or a cell holds an invalid value; it names the row.
    """
    return recordings_of(Path(path), read_rows(Path(path), REQUIRED))


def recordings_of(path: Path, table: pd.DataFrame) -> list[Recording]:
    """Return the recordings of a manifest's rows, as `read_manifest` does."""
    need_columns(path, table, REQUIRED)
    absent = [name for name in OPTIONAL if name not in table]
    for name in map(str, table):
        if name not in (*REQUIRED, *OPTIONAL) and (
            similar := difflib.get_close_matches(name, absent, 1, _SIMILARITY)
            or [known for known in absent if known == f"{name}_deg"]
        ):
            raise UserError(
                f"{path}: a column {name!r}; call it {similar[0]!r} if it is that, or remove it"
            )
    for name in ("azimuth_deg", *OPTIONAL[1:]):
        if name in table:
            limit = _LIMITS.get(name, np.inf)
            table[name] = column(path, table, name, limit=limit, is_optional=name in OPTIONAL)
    table["path"] = _files(path, table["file"])
    if (again := table.duplicated(["object_id", "sequence", "file"])).any():
        row = int(again.to_numpy().argmax())
        _reject(path, row, f"file {table['file'][row]!r} is in this sequence already")
    if "mask" in table:
        table["mask"] = _files(path, table["mask"])
    intrinsics = list(_intrinsics(path, table))
    return [
        Recording(
            str(object_id),
            str(sequence),
            rows.reset_index(drop=True),
            tuple(intrinsics[row] for row in rows.index),
        )
        for (object_id, sequence), rows in table.groupby(["object_id", "sequence"], sort=True)
    ]


def _reject(path: Path, row: int, what: str) -> NoReturn:
    # Row 1 of the file holds the names of the columns.
    raise UserError(f"{path}, row {row + 2}: {what}")


def _files(path: Path, names: pd.Series[str]) -> list[str | None]:
    """Return the files of a column, whose names are relative to the manifest's folder."""
    files: list[str | None] = []
    for row, name in enumerate(names):
        file = path.parent / name
        is_absent = names.name in OPTIONAL and not name
        if not (is_absent or file.is_file()):
            _reject(path, row, f"{names.name} {name!r} {missing(file) if name else 'is empty'}")
        files.append(None if is_absent else str(file))
    return files


def _intrinsics(path: Path, table: pd.DataFrame) -> Iterator[Intrinsics | None]:
    for row, values in enumerate(table.to_dict("records")):
        names = ("fx", "fy", "cx", "cy")
        known = {name: values[name] for name in names if np.isfinite(values.get(name, np.nan))}
        if not known:
            yield None
        elif "fx" not in known:
            _reject(path, row, f"{next(iter(known))} without fx; give fx too")
        else:
            try:
                yield Intrinsics(**{"fy": known["fx"]} | known)
            except UserError as error:
                _reject(path, row, str(error))


def run_network(
    recommender: Recommender,
    recording: Recording,
    intrinsics: str | None,
    depth_scale: float | None,
    report: Callable[[str, FrameError], None],
    near_m: float | None = None,
    far_m: float | None = None,
    mask_value: float | None = None,
) -> Sweep:
    """Return the crops and logits of a recording; rejected frames are reported and skipped.

    `intrinsics` (`nbv.frames.intrinsics.camera_of`) are of frames without any in the manifest. The
    object lies between `near_m` and `far_m` in every frame. `report` takes the file of a rejected
    frame, and the reason. Raise UserError where a file cannot be read, or every frame is rejected.
    """
    codes, kept, focal_px = [], [], []
    doubts: list[str] = []
    first: tuple[str, FrameError] | None = None
    name = f"object {recording.object_id!r}, sequence {recording.sequence!r}"
    for i, (row, listed) in enumerate(
        zip(recording.frames.to_dict("records"), recording.intrinsics, strict=True)
    ):
        mask, camera = row.get("mask"), camera_of(intrinsics, row["path"])
        known = listed or camera.intrinsics
        object_mask = read_mask(mask, mask_value) if isinstance(mask, str) else None
        try:
            depth_m = read_depth(row["path"], depth_scale, camera.unit_m)
            try:
                crop = recommender.crop(
                    depth_m, mask=object_mask, intrinsics=known, near_m=near_m, far_m=far_m
                )
            except FrameError:
                raise
            except UserError as error:
                raise error.about(row["path"]) from error
        except FrameError as error:
            report(row["path"], error)
            first = first or (row["path"], error)
            continue
        if reasons := (*crop.doubts, *(() if listed else camera.warnings)):
            doubts.append(f"{row['path']}: {reasons[0]}")
        codes.append(crop.codes)
        kept.append(i)
        focal_px.append(known.fx if known else float("nan"))
    if first and not kept:
        path, rejection = first
        raise rejection.about(f"{name}: every frame is rejected; the first, {path}")
    crops = np.stack(codes)
    logits = recommender.network(crops)
    warnings = recommender.lying_warnings(crops, logits)
    if doubts:
        warnings += (f"{len(doubts)} of {counted(len(kept), 'frame')}, as {doubts[0]}",)
    return Sweep(
        recording.object_id,
        recording.sequence,
        recording.elevation_deg,
        recording.azimuth_deg[kept],
        logits,
        crops,
        float(np.median(focal_px)),
        tuple(recording.frames["path"].iloc[kept]),
        tuple(f"{name}: {warning}" for warning in warnings),
    )

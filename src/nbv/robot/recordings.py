"""Recordings: frames of objects on a turntable, with known azimuths."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from nbv.errors import FrameError, UserError
from nbv.files import missing, read_rows
from nbv.robot.depth_files import read_depth, read_mask
from nbv.robot.intrinsics import Intrinsics, camera_of
from nbv.robot.recommender import Recommender
from nbv.robot.sweeps import Turn

NEEDED = ("object_id", "sequence", "file", "azimuth_deg")
OPTIONAL = ("mask", "elevation_deg", "fx", "fy", "cx", "cy")

# Of a name that is an optional one, mistyped: one letter of elevation_deg, and not its unit.
_ALIKE = 0.9


@dataclass(frozen=True)
class Recording:
    """Frames of one object, taken with one camera height.

    Attributes
    ----------
    object_id, sequence : str
    frames : DataFrame
        ``path, azimuth_deg`` and, where the manifest has them, ``mask, elevation_deg``, in the
        order of the manifest.
    intrinsics : tuple of Intrinsics or None
        Of each frame.
    """

    object_id: str
    sequence: str
    frames: pd.DataFrame
    intrinsics: tuple[Intrinsics | None, ...]

    @property
    def azimuth_deg(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Of each frame."""
        return self.frames["azimuth_deg"].to_numpy(dtype=np.float64)

    @property
    def elevation_deg(self) -> float:
        """The mean over the frames; NaN where the manifest says nothing."""
        if "elevation_deg" not in self.frames:
            return float("nan")
        return float(self.frames["elevation_deg"].mean())


def read_manifest(path: str | Path) -> list[Recording]:
    """Read a manifest: CSV with the columns `NEEDED`, and any of `OPTIONAL`.

    Names of files count from the manifest's folder; azimuths are degrees, counter-clockwise about
    the object seen from above.

    Raises
    ------
    UserError
        Where a column or a file is missing, a file occurs twice in a sequence, an azimuth is no
        number, or another cell holds what it cannot hold; it names the row.
    """
    path = Path(path)
    table = read_rows(path, NEEDED)
    for name in map(str, table):
        if name != (known := name.strip().lower()) and known in OPTIONAL:
            raise UserError(f"{path}: a column {name!r}; call it {known!r}")
    absent = [name for name in OPTIONAL if name not in table]
    for name in map(str, table):
        if name not in (*NEEDED, *OPTIONAL) and (
            alike := difflib.get_close_matches(name.lower(), absent, 1, _ALIKE)
            or [known for known in absent if known == f"{name.lower()}_deg"]
        ):
            raise UserError(
                f"{path}: a column {name!r}; call it {alike[0]!r} if it is that, or remove it"
            )
    for name in {"azimuth_deg", *OPTIONAL} - {"mask"}:
        if name in table:
            table[name] = _numbers(path, table[name])
    table["path"] = _files(path, table["file"])
    if (again := table.duplicated(["object_id", "sequence", "file"])).any():
        place = int(again.to_numpy().argmax())
        _refuse(path, place, f"file {table['file'][place]!r} is in this sequence already")
    if "mask" in table:
        table["mask"] = _files(path, table["mask"])
    intrinsics = list(_intrinsics(path, table))
    return [
        Recording(
            str(object_id),
            str(sequence),
            rows.reset_index(drop=True),
            tuple(intrinsics[place] for place in rows.index),
        )
        for (object_id, sequence), rows in table.groupby(["object_id", "sequence"], sort=True)
    ]


def _refuse(path: Path, place: int, what: str) -> NoReturn:
    # The first row is that of the names.
    raise UserError(f"{path}, row {place + 2}: {what}")


def _numbers(path: Path, texts: pd.Series[str]) -> pd.Series[float]:
    """Return a column of numbers; NaN where an optional one is empty."""
    numbers = pd.to_numeric(texts, errors="coerce").astype(float)
    name = str(texts.name)
    for place, (text, number) in enumerate(zip(texts, numbers, strict=True)):
        is_absent = name in OPTIONAL and text.strip().lower() in ("", "nan")
        if not (np.isfinite(number) or is_absent):
            _refuse(path, place, f"{name} is no number")
        if name == "elevation_deg" and abs(number) > 90:
            _refuse(path, place, f"elevation_deg={text} lies not between -90 and 90")
    return numbers


def _files(path: Path, names: pd.Series[str]) -> list[str | None]:
    """Return the files of a column, whose names count from the manifest's folder."""
    found: list[str | None] = []
    for place, name in enumerate(names):
        file = path.parent / name
        is_absent = names.name in OPTIONAL and not name
        if not (is_absent or file.is_file()):
            _refuse(path, place, f"{names.name} {name!r} {missing(file) if name else 'is no name'}")
        found.append(None if is_absent else str(file))
    return found


def _intrinsics(path: Path, table: pd.DataFrame) -> Iterator[Intrinsics | None]:
    for place, row in enumerate(table.to_dict("records")):
        names = ("fx", "fy", "cx", "cy")
        known = {name: row[name] for name in names if np.isfinite(row.get(name, np.nan))}
        if not known:
            yield None
        elif "fx" not in known:
            _refuse(path, place, f"{next(iter(known))} without fx; give fx too")
        else:
            try:
                yield Intrinsics(**{"fy": known["fx"]} | known)
            except UserError as error:
                _refuse(path, place, str(error))


def see(
    recommender: Recommender,
    recording: Recording,
    intrinsics: str | None,
    depth_scale: float | None,
    tell: Callable[[str, FrameError], None],
    near_m: float | None = None,
    far_m: float | None = None,
) -> Turn:
    """Return what a network makes of a recording; frames that are refused are told and left out.

    Parameters
    ----------
    recommender : Recommender
    recording : Recording
    intrinsics : str or None
        Of frames for which the manifest has none; see `nbv.robot.intrinsics.camera_of`.
    depth_scale : float or None
        See `nbv.robot.depth_files.read_depth`.
    tell : callable
        Takes the file of a frame that is refused, and why.
    near_m, far_m : float, optional
        The object lies between them in every frame, metres.

    Raises
    ------
    UserError
        Where a file cannot be read, or no frame is left.
    """
    codes, kept, focal_px = [], [], []
    first: tuple[str, FrameError] | None = None
    for place, (row, own) in enumerate(
        zip(recording.frames.to_dict("records"), recording.intrinsics, strict=True)
    ):
        mask, camera = row.get("mask"), camera_of(intrinsics, row["path"])
        known = own or camera.intrinsics
        object_mask = read_mask(mask) if isinstance(mask, str) else None
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
            tell(row["path"], error)
            first = first or (row["path"], error)
            continue
        codes.append(crop.codes)
        kept.append(place)
        focal_px.append(known.fx if known else float("nan"))
    if first and not kept:
        path, refusal = first
        raise refusal.about(
            f"object {recording.object_id!r}, sequence {recording.sequence!r}: every frame is "
            f"refused; the first, {path}"
        )
    crops = np.stack(codes)
    return Turn(
        recording.object_id,
        recording.sequence,
        recording.elevation_deg,
        recording.azimuth_deg[kept],
        recommender.network(crops),
        crops,
        float(np.median(focal_px)),
    )

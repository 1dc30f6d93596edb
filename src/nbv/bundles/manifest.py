"""Recordings: frames of objects on a turntable, with known azimuths."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.bundles.recommender import Recommender
from nbv.bundles.turns import Turn
from nbv.calibration.pairs import read_rows
from nbv.errors import UserError
from nbv.frames.depth_files import read_depth, read_mask
from nbv.frames.errors import FrameError
from nbv.frames.intrinsics import Intrinsics

NEEDED = ("object_id", "sequence", "file", "azimuth_deg")
OPTIONAL = ("mask", "elevation_deg", "fx", "fy", "cx", "cy")


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
        Where a column or a file is missing, or an azimuth is no number.
    """
    path = Path(path)
    table = read_rows(path, NEEDED)
    for name in ("azimuth_deg", *(set(OPTIONAL) - {"mask"})):
        if name in table:
            table[name] = pd.to_numeric(table[name], errors="coerce")
    if not np.isfinite(table["azimuth_deg"]).all():
        row = int((~np.isfinite(table["azimuth_deg"])).to_numpy().argmax())
        raise UserError(f"{path}, row {row + 2}: azimuth_deg is no number")
    table["path"] = [str(path.parent / name) for name in table["file"]]
    if "mask" in table:
        table["mask"] = [str(path.parent / name) if name else None for name in table["mask"]]
    for row, name in enumerate(table["file"]):
        if not (path.parent / name).is_file():
            raise UserError(f"{path}, row {row + 2}: file {name!r} does not exist")
    return list(_recordings(table))


def _recordings(table: pd.DataFrame) -> Iterator[Recording]:
    for (object_id, sequence), rows in table.groupby(["object_id", "sequence"], sort=True):
        frames = rows.reset_index(drop=True)
        yield Recording(str(object_id), str(sequence), frames, tuple(_intrinsics(frames)))


def _intrinsics(frames: pd.DataFrame) -> Iterator[Intrinsics | None]:
    known = "fx" in frames
    for row in frames.to_dict("records"):
        if not known or not np.isfinite(row["fx"]):
            yield None
            continue
        middle = {name: row[name] for name in ("cx", "cy") if np.isfinite(row.get(name, np.nan))}
        yield Intrinsics(row["fx"], row.get("fy", row["fx"]), **middle)


def see(
    recommender: Recommender,
    recording: Recording,
    intrinsics: Intrinsics | None,
    depth_scale: float | None,
    tell: Callable[[str], None],
) -> Turn:
    """Return what a network makes of a recording; frames that are refused are told and left out.

    Parameters
    ----------
    recommender : Recommender
    recording : Recording
    intrinsics : Intrinsics or None
        Of frames for which the manifest has none.
    depth_scale : float or None
        See `nbv.frames.depth_files.read_depth`.
    tell : callable
        Takes a line of text.

    Raises
    ------
    UserError
        Where a file cannot be read, or no frame is left.
    """
    codes, kept = [], []
    for place, (row, own) in enumerate(
        zip(recording.frames.to_dict("records"), recording.intrinsics, strict=True)
    ):
        mask = row.get("mask")
        try:
            crop = recommender.crop(
                read_depth(row["path"], depth_scale),
                mask=read_mask(mask) if isinstance(mask, str) else None,
                intrinsics=own or intrinsics,
            )
        except FrameError as error:
            tell(f"{row['path']} is left out: {error}")
            continue
        codes.append(crop.codes)
        kept.append(place)
    if not kept:
        raise UserError(
            f"every frame of object {recording.object_id!r}, sequence {recording.sequence!r} is "
            "refused: see the lines above"
        )
    crops = np.stack(codes)
    return Turn(
        recording.object_id,
        recording.sequence,
        recording.elevation_deg,
        recording.azimuth_deg[kept],
        recommender.network(crops),
        crops,
    )

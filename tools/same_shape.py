"""Print what bundles err on a rendered mug of the real one's shape: same_shape.py MANIFEST BUNDLES.

The mug of the recordings in MANIFEST is rendered from the azimuths of their frames: with its true
depth, with a first Kinect's noise, and both once more with the pixels of the real frame alone, so
that what the camera lost there is lost here, too. Among these pixels, the rendered mug may still
show some of its handle where the real one shows nothing of it. So both are rendered a third time,
without a handle in these frames. The real frames are there as they are, and with the zero that
their handle gives. See docs/reference/bundles/README.md.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
import trimesh
from numpy.typing import NDArray
from scipy import ndimage

from nbv.core.angles import wrap_deg
from nbv.data.meshes import Mesh, as_mesh
from nbv.data.normalisation import normalise
from nbv.data.procedural.solids import Points, join, revolve, superellipse, sweep
from nbv.robot.errors import FrameError
from nbv.robot.evaluation import RECOMMENDED, SINGLE, evaluate
from nbv.robot.recommender import Recommender
from nbv.robot.recordings import read_manifest, see
from nbv.robot.sweeps import Turn
from nbv.robot.synthetic import draw_frame

RADIUS, HEIGHT, WALL, FLOOR = 0.0385, 0.078, 0.0035, 0.006
"""Of the body, metres, as measured in the level recording; wall and floor are usual ones."""

REACH, SPAN, TOP, HALF_WIDTH, HALF_THICK = 0.0225, 0.044, 0.0624, 0.0075, 0.0035
"""Of the handle's centre line and its outline, metres, from the same recording."""

VIEWS = {"1": ((3.0, 0.755),), "2": ((25.0, 0.95), (33.0, 0.95))}
"""Elevations, degrees, and distance, metres, of each recording.

From above, 25° follows from the ellipse of the rim, and 33° from the depth along the wall.
"""

NO_HANDLE_DEG = {"1": (50.0, 128.0), "2": (39.0, 159.0)}
"""From the first to the last azimuth at which the real crops show no handle, judged by eye."""

ZERO_DEG = {"1": 1.7, "2": -2.1}
"""What the azimuths of each recording are off by, as its handle says: tools/recording_zero.py."""

N_DRAWS = 10
"""Draws of the sensor's noise."""

_SHIFT_PX = 8

Codes = NDArray[np.uint8]


def the_mug() -> tuple[Mesh, Mesh, float]:
    """Return the mug, of unit diagonal, the same without its handle, and its diagonal in metres."""
    height = np.linspace(0.0, HEIGHT, 25)
    outer = np.stack([np.full(25, RADIUS), height], axis=-1)
    inside = outer[height > FLOOR][::-1] - (WALL, 0.0)
    rim = [[RADIUS - WALL / 2, HEIGHT + WALL / 3]]
    bottom = [[0.97 * (RADIUS - WALL), FLOOR]]
    body = revolve(np.concatenate([outer, rim, inside, bottom]), n=96)
    handle = sweep(_handle(), superellipse(HALF_WIDTH, HALF_THICK, 3.0, n=20), (1.0, 0.0, 0.0))
    mug: trimesh.Trimesh = join([body, handle])
    diagonal_m = float(np.linalg.norm(np.ptp(mug.vertices, axis=0)))
    mesh = as_mesh(normalise(mug, "+z", "+x", 0.0, "origin"))
    # The faces of the body come first.
    return mesh, mesh._replace(faces=mesh.faces[: len(body.faces)]), diagonal_m


def _handle() -> Points:
    """Return the centre line (25, 3): half a rounded rectangle, its ends in the wall."""
    angle = np.linspace(0.5 * np.pi, -0.5 * np.pi, 25)
    out, up = (np.sign(part) * np.abs(part) ** (2 / 3) for part in (np.cos(angle), np.sin(angle)))
    along = RADIUS - WALL / 2 + REACH * out
    return np.stack([np.zeros(25), -along, TOP - SPAN / 2 + SPAN / 2 * up], axis=-1)


def with_pixels_of(rendered: Codes, real: Codes) -> Codes:
    """Return a rendered crop (side, side) with the pixels of a real one.

    It is moved by up to `_SHIFT_PX` to where both silhouettes overlap most. A pixel of the real
    crop that it has not takes the depth of the nearest one that it has.
    """
    seen = real > 0
    shifts = range(-_SHIFT_PX, _SHIFT_PX + 1)
    moved = (np.roll(rendered, (down, right), (0, 1)) for down in shifts for right in shifts)
    best = max(moved, key=lambda crop: _overlap(crop > 0, seen))
    _, nearest = ndimage.distance_transform_edt(best == 0, return_indices=True)
    return np.where(seen, best[tuple(nearest)], 0).astype(np.uint8)


def _overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float((one & other).sum() / (one | other).sum())


def turns(recommender: Recommender, real: Turn) -> Iterator[tuple[dict[str, object], Turn]]:
    """Yield what the frames of one recording are like, and these frames."""
    mug, body, diagonal_m = the_mug()
    first_deg, last_deg = NO_HANDLE_DEG[real.sequence]
    shows_none = (real.azimuth_deg >= first_deg) & (real.azimuth_deg <= last_deg)

    def of(codes: list[Codes]) -> Turn:
        crops = np.stack(codes)
        return replace(real, codes=crops, logits=recommender.network(crops))

    def cut(codes: list[Codes]) -> Turn:
        return of([with_pixels_of(*pair) for pair in zip(codes, real.codes, strict=True)])

    def render(
        meshes: list[Mesh], view: tuple[float, float], sensor: str, draw: int
    ) -> list[Codes]:
        crops = []
        for place, (mesh, azimuth_deg) in enumerate(zip(meshes, real.azimuth_deg, strict=True)):
            seed = 1000 * draw + place
            frame = draw_frame(mesh, float(azimuth_deg), *view, diagonal_m, seed, sensor=sensor)
            crops.append(recommender.crop(frame.depth_m, intrinsics=frame.intrinsics).codes)
        return crops

    for view in VIEWS[real.sequence]:
        for sensor, depth, n_draws in (("none", "true", 1), ("kinect", "noisy", N_DRAWS)):
            for draw in range(n_draws):
                line = {"elevation_deg": view[0], "depth": depth, "draw": draw}
                crops = render([mug] * len(shows_none), view, sensor, draw)
                yield line | {"pixels": "rendered"}, of(crops)
                yield line | {"pixels": "real"}, cut(crops)
                crops = render([body if none else mug for none in shows_none], view, sensor, draw)
                yield line | {"pixels": "real, no handle"}, cut(crops)
    line = {"elevation_deg": math.nan, "depth": "real", "draw": 0}
    yield line | {"pixels": "real"}, real
    azimuth_deg = wrap_deg(real.azimuth_deg + ZERO_DEG[real.sequence])
    yield line | {"pixels": "real, zero by the handle"}, replace(real, azimuth_deg=azimuth_deg)


def main() -> None:
    """Print a table of all recordings and bundles."""
    manifest, *bundles = sys.argv[1:]
    rows: list[dict[str, object]] = []
    for training, name in enumerate(bundles):
        recommender = Recommender.load(name, "numpy")
        for recording in read_manifest(manifest):
            real = see(recommender, recording, None, None, _refused)
            for line, turn in turns(recommender, real):
                errors = evaluate(recommender.bundle, [turn], n_views=(2,), n_random=1)
                mae_deg = errors.set_index("choice")["mae_deg"]
                row = {"training": training, "sequence": real.sequence} | line
                row |= {"one_view_deg": mae_deg[SINGLE], "two_views_deg": mae_deg[RECOMMENDED]}
                rows.append(row)
    pd.DataFrame(rows).to_csv(sys.stdout, index=False, float_format="%.2f")


def _refused(path: str, error: FrameError) -> None:
    raise SystemExit(f"{path}: {error}")


if __name__ == "__main__":
    main()

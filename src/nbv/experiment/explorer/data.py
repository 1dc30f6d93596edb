"""What the explorer's page holds, as compact text: images, lookup tables and outcomes.

The outcomes are those of the evaluation files, in hundredths of a degree. The page averages a
method's two estimates itself and adds the stored difference between that and the file's pose.
"""

from __future__ import annotations

import base64
import io
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image

from nbv.core.circle.criteria import cost_unit
from nbv.core.circle.estimates import Posteriors
from nbv.errors import UserError
from nbv.experiment.report.figures.views import depth_limits, shade
from nbv.experiment.results import Unit
from nbv.experiment.statistics.metrics import FRONT_BACK_DEG
from nbv.tables.lookup import LookupTable

Codes = NDArray[np.uint8]
Hundredths = NDArray[np.int64]

FULL_CIRCLE = 36000
"""360 degrees in hundredths of a degree."""

# Relative to a table's largest value; codes for smaller values would make all others coarser.
_LEAST_PART = 1e-9


def hundredths(angle_deg: NDArray[np.floating[Any]]) -> Hundredths:
    """Return angles in hundredths of a degree, in [0, 36000)."""
    return np.rint(np.asarray(angle_deg, dtype=np.float64) * 100.0).astype(np.int64) % FULL_CIRCLE


def wrapped(difference: Hundredths) -> Hundredths:
    """Wrap differences of angles to [-18000, 18000)."""
    return np.asarray((difference + FULL_CIRCLE // 2) % FULL_CIRCLE - FULL_CIRCLE // 2)


def byte_planes(values: Hundredths) -> bytes:
    """Return integers in [-32768, 32767] as bytes: all high ones, then all low ones.

    Values near 0 of either sign have a high byte of 0, which compresses well.
    """
    folded = np.where(values >= 0, 2 * values, -2 * values - 1).astype(np.uint16).ravel()
    return (folded >> 8).astype(np.uint8).tobytes() + (folded & 0xFF).astype(np.uint8).tobytes()


def rows_differenced(codes: Codes) -> bytes:
    """Return codes (B, B) as differences along both axes, modulo 256, which compress well."""
    down = np.diff(codes, axis=0, prepend=np.zeros((1, codes.shape[1]), np.uint8))
    return np.diff(down, axis=1, prepend=np.zeros((len(codes), 1), np.uint8)).tobytes()


def as_text(*parts: bytes) -> str:
    """Compress bytes together and return them in base64."""
    return base64.b64encode(zlib.compress(b"".join(parts), 9)).decode("ascii")


@dataclass(frozen=True)
class Quantised:
    """A table in 256 steps; `low` and `high` are the values of the codes 0 and 255."""

    codes: Codes
    low: float
    high: float


def quantised(table: NDArray[np.floating[Any]]) -> Quantised:
    """Quantise a table in equal steps from its least to its largest value."""
    values = np.asarray(table, dtype=np.float64)
    low, high = float(values.min()), float(values.max())
    steps = (values - low) * (255.0 / (high - low)) if high > low else np.zeros_like(values)
    return Quantised(np.rint(steps).astype(np.uint8), low, high)


def quantised_logs(probabilities: NDArray[np.floating[Any]]) -> Quantised:
    """Quantise the logs of probabilities in equal steps, for equal relative precision.

    Probabilities are at least a billionth of the largest.
    """
    values = np.asarray(probabilities, dtype=np.float64)
    return quantised(np.log(np.maximum(values, _LEAST_PART * values.max())))


N_SHOWN = 36
"""Images around an object; fewer where it has fewer views."""

COLUMNS = 6
"""Images in a row of the picture."""

_LARGEST_SIDE = 64
_QUALITY = 30


@dataclass(frozen=True)
class Ring:
    """Depth images around one object, in one picture with `COLUMNS` images per row.

    `data` is a WebP picture in base64. Its images are evenly spaced from azimuth 0 on, and `side`
    is theirs in pixels.
    """

    data: str
    n_images: int
    side: int


def ring_of(codes: Codes) -> Ring:
    """Return the ring of one object's images (n_views, side, side), in the figures' grey levels."""
    n_views = len(codes)
    n_images = max(n for n in range(1, N_SHOWN + 1) if n_views % n == 0)
    shown = np.asarray(codes[:: n_views // n_images])
    grey = np.rint(255.0 * shade(shown, depth_limits(shown))).astype(np.uint8)
    side = min(grey.shape[1], _LARGEST_SIDE)
    if side < grey.shape[1]:
        tiles = [Image.fromarray(each).resize((side, side), Image.Resampling.BOX) for each in grey]
        grey = np.stack([np.asarray(tile) for tile in tiles])
    rows = -(-n_images // COLUMNS)
    padded = np.full((rows * COLUMNS, side, side), 255, dtype=np.uint8)
    padded[:n_images] = grey
    grid = padded.reshape(rows, COLUMNS, side, side).swapaxes(1, 2)
    picture = grid.reshape(rows * side, COLUMNS * side)
    stored = io.BytesIO()
    Image.fromarray(picture).save(stored, "webp", quality=_QUALITY, method=6)
    return Ring(base64.b64encode(stored.getvalue()).decode("ascii"), n_images, side)


@dataclass(frozen=True)
class PageTable:
    """A lookup table as the page stores it: logs of L[viewpoint, estimate], and A[estimate, delta].

    Calibration sees every viewpoint equally often, so V[e] is L[., e] normalised to sum 1, and the
    page stores L alone. `unit` is that of the cost.
    """

    logs: Quantised
    cost: Quantised
    unit: str

    @property
    def facts(self) -> dict[str, Any]:
        """What the page needs in order to decode `text`."""
        return {
            "bins": len(self.logs.codes),
            "low": self.logs.low,
            "high": self.logs.high,
            "costLow": self.cost.low,
            "costHigh": self.cost.high,
            "unit": self.unit,
        }

    @property
    def text(self) -> str:
        """Both tables, the codes of L first."""
        return as_text(rows_differenced(self.logs.codes), rows_differenced(self.cost.codes))


def page_table(table: LookupTable) -> PageTable:
    """Return a lookup table as the page stores it."""
    return PageTable(
        quantised_logs(table.estimate_likelihood),
        quantised(table.cost),
        cost_unit(table.criterion, {"spread": table.spread}),
    )


def distributions_text(posteriors: Posteriors) -> str:
    """Return the distributions of the images at the azimuths of the classes, as text.

    Square roots in 256 steps, relative to the largest of the distribution; (n_objects, k, k) bytes.
    """
    rows = posteriors.distributions
    n_views, n_classes = rows.shape[1:]
    shown = rows[:, :: n_views // n_classes]
    roots = np.sqrt(shown / shown.max(axis=-1, keepdims=True))
    return as_text(np.rint(255.0 * roots).astype(np.uint8).tobytes())


@dataclass(frozen=True)
class Outcomes:
    """One unit's outcomes, objects in the order of the folds that test them.

    Attributes
    ----------
    folds : tuple of int
        The fold that tests each object.
    n_views : int
        First views of each object, evenly spaced.
    estimate : ndarray (n_objects, n_views) int64
        The estimate from the first view alone, hundredths of a degree.
    rotation : dict of str to ndarray (n_objects, n_views) int64
        Rotation to the second view by method, in steps of 360° / n_views; absent for methods
        without a second view.
    pose : dict of str to ndarray (n_objects, n_views) int64
        Fused pose by method, hundredths of a degree.
    means : dict of str to list
        Mean errors by method and object, degrees to two decimals.
    overall : dict of str to dict
        By method, over all first views: the mean error, the part of errors above 90° in it (both in
        degrees), and their share in percent.
    """

    object_ids: tuple[str, ...]
    folds: tuple[int, ...]
    n_views: int
    estimate: Hundredths
    rotation: dict[str, Hundredths]
    pose: dict[str, Hundredths]
    means: dict[str, list[float]]
    overall: dict[str, dict[str, float]]


def outcomes_of(unit: Unit, frame: pd.DataFrame) -> Outcomes:
    """Return the outcomes of a frame of `nbv.experiment.results.load_evaluations`.

    Raise UserError where methods have different estimates for the same view.
    """
    by_method = {str(name): part for name, part in frame.groupby("method", observed=True)}
    first = next(iter(by_method.values())).drop_duplicates("object_id")
    object_ids, folds = tuple(first["object_id"]), tuple(first["fold"].astype(int))
    shape = (len(object_ids), -1)
    estimate_deg = _table(next(iter(by_method.values())), "initial_estimate_deg", shape)
    n_views = estimate_deg.shape[1]
    rotation, pose = {}, {}
    means: dict[str, list[float]] = {}
    for method, part in by_method.items():
        rows = part.set_index("object_id").loc[list(object_ids)]
        _check_same(unit, method, _table(rows, "initial_estimate_deg", shape), estimate_deg)
        pose[method] = hundredths(_table(rows, "pose_estimate_deg", shape))
        if rows["delta_deg"].notna().all():
            delta_deg = _table(rows, "delta_deg", shape)
            rotation[method] = np.rint(delta_deg * n_views / 360.0).astype(np.int64)
            seen = np.take_along_axis(
                estimate_deg, (np.arange(n_views) + rotation[method]) % n_views, axis=1
            )
            _check_same(unit, method, _table(rows, "next_estimate_deg", shape), seen)
        means[method] = _rounded(_table(rows, "error_deg", shape).mean(axis=1))
    return Outcomes(
        object_ids,
        folds,
        n_views,
        hundredths(estimate_deg),
        rotation,
        pose,
        means,
        {method: _overall(part["error_deg"]) for method, part in by_method.items()},
    )


def expected_pose(estimate: Hundredths, rotation: Hundredths | None) -> Hundredths:
    """Return the pose halfway between the first estimate and the second, rotated back (Eq. 7).

    In whole hundredths of a degree, (n_objects, n_views), exactly as on the page; the first
    estimate without a second view.
    """
    if rotation is None:
        return estimate
    n_views = estimate.shape[1]
    second = np.take_along_axis(estimate, (np.arange(n_views) + rotation) % n_views, axis=1)
    back = wrapped(second - rotation * (FULL_CIRCLE // n_views) - estimate)
    return np.asarray((estimate + back // 2) % FULL_CIRCLE)


def outcomes_text(outcomes: Outcomes) -> str:
    """Return the outcomes as text: estimates, then for each method rotations and poses.

    An estimate is stored as its error less that of the view before, a pose as its difference to
    `expected_pose`.
    """
    n_views = outcomes.n_views
    off = wrapped(outcomes.estimate - np.arange(n_views) * (FULL_CIRCLE // n_views))
    parts = [byte_planes(wrapped(np.diff(off, axis=1, prepend=0)))]
    for method, pose in outcomes.pose.items():
        rotation = outcomes.rotation.get(method)
        if rotation is not None:
            parts.append(byte_planes(rotation))
        parts.append(byte_planes(wrapped(pose - expected_pose(outcomes.estimate, rotation))))
    return as_text(*parts)


def _table(frame: pd.DataFrame, column: str, shape: tuple[int, int]) -> np.ndarray:
    return frame[column].to_numpy(dtype=np.float64).reshape(shape)


def _check_same(unit: Unit, method: str, values: np.ndarray, expected: np.ndarray) -> None:
    if not np.array_equal(values, expected):
        raise UserError(
            f"evaluation of {unit[0]} at {unit[1]}°: {method} has other estimates than the other "
            "methods; delete the evaluations and run the same command again"
        )


def _overall(error_deg: pd.Series) -> dict[str, float]:
    above = error_deg > FRONT_BACK_DEG
    mean, part_above, share = _rounded(
        [error_deg.mean(), error_deg.where(above, 0.0).mean(), 100.0 * above.mean()]
    )
    return {"mean": mean, "above": part_above, "share": share}


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), 2) for value in values]

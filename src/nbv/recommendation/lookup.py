"""The lookup table: everything a robot needs once its calibration is done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.angles import nearest_bin, travel_deg
from nbv.calibration.density import likelihoods
from nbv.errors import UserError, nearest
from nbv.files import read_arrays, write_arrays
from nbv.recommendation.criteria import CRITERIA


@dataclass(frozen=True)
class LookupTable:
    """A criterion tabulated for one estimator.

    Attributes
    ----------
    viewpoint_likelihood : ndarray (B, B) float32
        V[estimate, viewpoint].
    estimate_likelihood : ndarray (B, B) float32
        L[viewpoint, estimate].
    ambiguity : ndarray (B, B) float32
        A[estimate, delta].
    recommended_delta_deg : ndarray (B,) int64
        The rotation of least ambiguity for each estimate, degrees in [0, 360).
    bandwidth_deg, pseudo_observations : float
        The density's settings.
    reading, spread : str
        The criterion's settings; see `nbv.recommendation.criteria.pose_ambiguity`.
    """

    viewpoint_likelihood: NDArray[np.float32]
    estimate_likelihood: NDArray[np.float32]
    ambiguity: NDArray[np.float32]
    recommended_delta_deg: NDArray[np.int64]
    bandwidth_deg: float
    pseudo_observations: float
    reading: str
    spread: str

    def recommend(self, estimate_deg: ArrayLike) -> NDArray[np.int64]:
        """Return the recommended rotation for each estimate, degrees in [0, 360)."""
        bins = nearest_bin(estimate_deg, len(self.ambiguity))
        return np.asarray(self.recommended_delta_deg[bins])


def least_ambiguous_delta(ambiguity: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """Return the argmin of each row of A[estimate, delta] (Eq. 2), in degrees.

    Of equal minima the one of smallest travel is taken, then the smaller delta.
    """
    n_bins = ambiguity.shape[1]
    deltas = np.arange(n_bins) * (360.0 / n_bins)
    order = np.lexsort((deltas, travel_deg(deltas)))
    best = order[np.argmin(ambiguity[:, order], axis=1)]
    recommended: NDArray[np.int64] = np.rint(deltas[best]).astype(np.int64)
    return recommended


def build_lookup(
    estimate_deg: NDArray[np.float64],
    criterion: str,
    settings: Mapping[str, Any],
    *,
    bandwidth_deg: float,
    pseudo_observations: float,
    n_bins: int = 360,
) -> LookupTable:
    """Build a lookup table from calibration estimates.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        The estimate for every view; view k of n has the azimuth 360 k / n.
    criterion : str
        A name in `nbv.recommendation.criteria.CRITERIA`.
    settings : mapping
        The criterion's settings.
    bandwidth_deg, pseudo_observations, n_bins
        See `nbv.calibration.density.likelihoods`.

    Raises
    ------
    UserError
        For an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise UserError(f"criterion {criterion!r} is unknown: {nearest(criterion, CRITERIA)}")
    n_views = estimate_deg.shape[1]
    azimuth_deg = np.broadcast_to(np.arange(n_views) * (360.0 / n_views), estimate_deg.shape)
    pair = likelihoods(
        estimate_deg,
        azimuth_deg,
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        n_bins=n_bins,
    )
    ambiguity = CRITERIA[criterion](pair, settings)
    return LookupTable(
        viewpoint_likelihood=pair.viewpoint.astype(np.float32),
        estimate_likelihood=pair.estimate.astype(np.float32),
        ambiguity=ambiguity,
        recommended_delta_deg=least_ambiguous_delta(ambiguity),
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        reading=settings["reading"],
        spread=settings["spread"],
    )


def save_lookup(path: str | Path, table: LookupTable) -> None:
    """Write a table as `.npz`, one array for each of its attributes."""
    write_arrays(path, {item.name: np.asarray(getattr(table, item.name)) for item in fields(table)})


def load_lookup(path: str | Path) -> LookupTable:
    """Read what `save_lookup` wrote."""
    stored = read_arrays(path)
    return LookupTable(
        viewpoint_likelihood=stored["viewpoint_likelihood"],
        estimate_likelihood=stored["estimate_likelihood"],
        ambiguity=stored["ambiguity"],
        recommended_delta_deg=stored["recommended_delta_deg"],
        bandwidth_deg=float(stored["bandwidth_deg"]),
        pseudo_observations=float(stored["pseudo_observations"]),
        reading=str(stored["reading"]),
        spread=str(stored["spread"]),
    )

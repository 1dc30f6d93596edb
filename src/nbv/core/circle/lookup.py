"""The lookup table: the recommended rotation for each estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.choose import least_cost
from nbv.core.circle.angles import is_angle, nearest_bin, travel_deg
from nbv.core.circle.criteria import tabulate
from nbv.core.circle.evidence import Evidence
from nbv.errors import UserError


@dataclass(frozen=True)
class CostTable:
    """A criterion tabulated for one estimator; `nbv.LookupTable` adds files.

    Attributes
    ----------
    viewpoint_likelihood : ndarray (B, B) float32
        V[estimate, viewpoint].
    estimate_likelihood : ndarray (B, B) float32
        L[viewpoint, estimate].
    cost : ndarray (B, B) float32
        A[estimate, delta], in the unit of `nbv.core.circle.criteria.cost_unit`.
    recommended_delta_deg : ndarray (B,) int64
        The rotation of least cost for each estimate, degrees in [0, 360), travel included.
    bandwidth_deg, pseudo_observations : float
        Parameters of the density.
    criterion : str
        A name in `nbv.core.circle.criteria.CRITERIA`.
    pose_likelihood, spread : str
        Parameters of the criterion; see `nbv.core.circle.criteria`.
    travel_cost, max_travel_deg : float
        Parameters of the recommended rotations; see `least_cost_delta`.
    """

    viewpoint_likelihood: NDArray[np.float32]
    estimate_likelihood: NDArray[np.float32]
    cost: NDArray[np.float32]
    recommended_delta_deg: NDArray[np.int64]
    bandwidth_deg: float
    pseudo_observations: float
    pose_likelihood: str
    spread: str
    criterion: str
    travel_cost: float = 0.0
    max_travel_deg: float = 180.0

    def recommend(self, estimate_deg: ArrayLike) -> NDArray[np.int64]:
        """Return the rotation to the next view for each estimate, degrees in [0, 360).

        It is the rotation of least cost, travel included, that travels more than a bin: the same
        view again repeats the same error. With few calibration objects its cost may still be least,
        because criteria assume that views are independent. A table whose `max_travel_deg` allows no
        more than a bin gives `least_cost`.

        Raises
        ------
        UserError
            If an estimate is not a finite number.
        """
        return np.asarray(self._next_view_deg[self._bins(estimate_deg)])

    def least_cost(self, estimate_deg: ArrayLike) -> NDArray[np.int64]:
        """Return the rotation of least cost for each estimate (Eq. 2), however short.

        Raises
        ------
        UserError
            If an estimate is not a finite number.
        """
        return np.asarray(self.recommended_delta_deg[self._bins(estimate_deg)])

    def _bins(self, estimate_deg: ArrayLike) -> NDArray[np.int64]:
        if not is_angle(estimate_deg).all():
            raise UserError("an estimate is not a finite number of degrees, or beyond 1e6")
        return np.asarray(nearest_bin(estimate_deg, len(self.cost)), dtype=np.int64)

    @cached_property
    def _next_view_deg(self) -> NDArray[np.int64]:
        n_bins = len(self.cost)
        width = 360.0 / n_bins
        if self.max_travel_deg <= width:
            return self.recommended_delta_deg
        stays = travel_deg(self.recommended_delta_deg) <= width
        travel = travel_deg(np.arange(n_bins) * width)
        moving = np.where(travel > width, self.cost[stays], np.inf)
        delta_deg = self.recommended_delta_deg.copy()
        delta_deg[stays] = recommended_delta(moving, vars(self))
        return delta_deg


LIMITS = ("travel_cost", "max_travel_deg")
"""Attributes of a table that tables of earlier versions lack; they have no such limits."""


def least_cost_delta(
    cost: NDArray[np.floating[Any]],
    *,
    travel_cost: float = 0.0,
    max_travel_deg: float = 180.0,
) -> NDArray[np.int64]:
    """Return the argmin of each row of A[belief, delta] (Eq. 2), in degrees.

    Parameters
    ----------
    cost : ndarray (n, B)
    travel_cost : float, 0 or more
        Cost of a degree of travel, in the unit of A.
    max_travel_deg : float in [0, 180]
        The longest travel allowed.

    Returns
    -------
    ndarray (n,) int64
        In [0, 360). Among equal minima, the shortest travel wins, then the smaller delta.

    Raises
    ------
    UserError
        If a cost is NaN, which argmin would take for the least.
    """
    n_bins = cost.shape[1]
    deltas = np.arange(n_bins) * (360.0 / n_bins)
    travel = travel_deg(deltas)
    total = np.where(travel <= max_travel_deg, cost + travel_cost * travel, np.inf)
    if np.isnan(total).any():
        raise UserError("a rotation's cost is NaN: the estimates are damaged; make them again")
    best = least_cost(total, travel)
    recommended: NDArray[np.int64] = np.rint(deltas[best]).astype(np.int64)
    return recommended


def recommended_delta(
    cost: NDArray[np.floating[Any]], settings: Mapping[str, Any]
) -> NDArray[np.int64]:
    """Return `least_cost_delta` with the ``travel_cost`` and ``max_travel_deg`` of `settings`."""
    return least_cost_delta(cost, **{key: settings[key] for key in LIMITS if key in settings})


def build_lookup(evidence: Evidence, criterion: str, fusion: str = "average") -> CostTable:
    """Tabulate a criterion and find the rotations of least cost.

    Same parameters and errors as `nbv.core.circle.criteria.tabulate`.
    """
    cost = tabulate(criterion, evidence, fusion)
    return CostTable(
        viewpoint_likelihood=evidence.conditionals.viewpoint.astype(np.float32),
        estimate_likelihood=evidence.conditionals.estimate.astype(np.float32),
        cost=cost,
        recommended_delta_deg=recommended_delta(cost, evidence.settings),
        bandwidth_deg=float(evidence.bandwidth_deg),
        pseudo_observations=float(evidence.pseudo_observations),
        pose_likelihood=evidence.settings["pose_likelihood"],
        spread=evidence.settings["spread"],
        criterion=criterion,
        **{key: float(evidence.settings[key]) for key in LIMITS if key in evidence.settings},
    )

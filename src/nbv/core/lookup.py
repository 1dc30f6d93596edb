"""The lookup table: the recommended rotation for each estimate."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import is_angle, nearest_bin, travel_deg
from nbv.core.choose import least_cost
from nbv.core.criteria import CRITERIA, POSE_LIKELIHOODS, SPREADS, cost_unit, tabulate
from nbv.core.evidence import Evidence
from nbv.errors import UserError
from nbv.files import (
    CALIBRATE_AGAIN,
    calibrated_file,
    check_distributions,
    damaged,
    read_arrays,
    readable,
    write_arrays,
)


@dataclass(frozen=True)
class LookupTable:
    """A criterion tabulated for one estimator.

    Attributes
    ----------
    viewpoint_likelihood : ndarray (B, B) float32
        V[estimate, viewpoint].
    estimate_likelihood : ndarray (B, B) float32
        L[viewpoint, estimate].
    cost : ndarray (B, B) float32
        A[estimate, delta], in the unit of `nbv.core.criteria.cost_unit`.
    recommended_delta_deg : ndarray (B,) int64
        The rotation of least cost for each estimate, degrees in [0, 360), travel included.
    bandwidth_deg, pseudo_observations : float
        Parameters of the density.
    criterion : str
        A name in `nbv.core.criteria.CRITERIA`.
    pose_likelihood, spread : str
        Parameters of the criterion; see `nbv.core.criteria`.
    travel_cost, max_travel_deg : float
        Parameters of the recommended rotations; see `least_cost_delta`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> estimates = np.arange(0.0, 360.0, 10.0)[None]  # one object, always right
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> params = {"bandwidth_deg": 8, "pseudo_observations": 3, "n_bins": 36}
    >>> evidence = nbv.gather_evidence(estimates, density, **params)
    >>> table = nbv.build_lookup(evidence, "pose_ambiguity")
    >>> table.criterion, table.cost.shape
    ('pose_ambiguity', (36, 36))
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

    @classmethod
    def load(cls, path: str | Path) -> LookupTable:
        """Read a file of `save`.

        Raises
        ------
        UserError
            If the file cannot be read, or a value is not one that `build_lookup` makes. A file
            without `travel_cost` and `max_travel_deg` has no such limits.
        """
        names = [item.name for item in fields(cls)]
        stored = read_arrays(calibrated_file(path), names[: -len(_LIMITS)], CALIBRATE_AGAIN)
        with readable(path, CALIBRATE_AGAIN):
            # An array without axes holds a number or a text.
            values: dict[str, Any] = {
                name: stored[name] if stored[name].ndim else stored[name].item()
                for name in names
                if name in stored
            }
            table = cls(**values)
            n_bins = len(table.cost)
            for density in (table.viewpoint_likelihood, table.estimate_likelihood):
                check_distributions(path, density, (n_bins, n_bins), CALIBRATE_AGAIN)
            if problem := table._problem():
                raise damaged(path, problem, CALIBRATE_AGAIN)
        return table

    def _problem(self) -> str | None:
        """Return what `build_lookup` does not make, or None."""
        known: dict[str, Container[str]]
        known = {"criterion": CRITERIA, "spread": SPREADS, "pose_likelihood": POSE_LIKELIHOODS}
        wrong = [name for name, choices in known.items() if str(getattr(self, name)) not in choices]
        for name in ("bandwidth_deg", "pseudo_observations", *_LIMITS):
            value = getattr(self, name)
            if type(value) not in (int, float) or not 0 <= value < math.inf:
                wrong.append(name)
        if wrong:
            return f"{wrong[0]} is {getattr(self, wrong[0])!r}"
        n_bins = len(self.cost)
        if self.cost.dtype.kind != "f" or self.cost.shape != (n_bins, n_bins) or n_bins < 4:
            return f"costs are {self.cost.dtype} of shape {self.cost.shape}"
        unit = cost_unit(self.criterion, {"spread": self.spread})
        # A cost without a unit may be that of a user's criterion.
        most = {"nats": math.log(n_bins), "degrees": 180.0}.get(unit, 1e6)
        least = -most if unit == "1" else 0.0
        # Beyond the rounding of single precision; NaN is wrong too.
        if not ((self.cost > least - 1e-3) & (self.cost < most + 1e-3)).all():
            return f"a cost is not between {least:g} and {most:.4g}"
        best_deg = recommended_delta(self.cost, vars(self))
        is_least = np.array_equal(self.recommended_delta_deg, best_deg)
        return None if is_least else "a recommended rotation is not that of least cost"

    def save(self, path: str | Path, further: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Write the attributes, and `further` arrays, as ``.npz``."""
        arrays = {item.name: np.asarray(getattr(self, item.name)) for item in fields(self)}
        write_arrays(path, arrays | dict(further or {}))

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


_LIMITS = ("travel_cost", "max_travel_deg")


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
    return least_cost_delta(cost, **{key: settings[key] for key in _LIMITS if key in settings})


def build_lookup(evidence: Evidence, criterion: str, fusion: str = "average") -> LookupTable:
    """Tabulate a criterion and find the rotations of least cost.

    Same parameters and errors as `nbv.core.criteria.tabulate`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> truth = np.arange(360.0)
    >>> estimates = np.where(np.abs(truth - 90) < 60, 90.0, truth)  # blind around 90 degrees
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> evidence = nbv.gather_evidence(
    ...     estimates[None], density, bandwidth_deg=8, pseudo_observations=3
    ... )
    >>> table = nbv.build_lookup(evidence, "pose_ambiguity")
    >>> bool(60 < table.recommend(90.0) < 300)  # it leaves the blind range
    True
    """
    cost = tabulate(criterion, evidence, fusion)
    return LookupTable(
        viewpoint_likelihood=evidence.conditionals.viewpoint.astype(np.float32),
        estimate_likelihood=evidence.conditionals.estimate.astype(np.float32),
        cost=cost,
        recommended_delta_deg=recommended_delta(cost, evidence.settings),
        bandwidth_deg=float(evidence.bandwidth_deg),
        pseudo_observations=float(evidence.pseudo_observations),
        pose_likelihood=evidence.settings["pose_likelihood"],
        spread=evidence.settings["spread"],
        criterion=criterion,
        **{key: float(evidence.settings[key]) for key in _LIMITS if key in evidence.settings},
    )

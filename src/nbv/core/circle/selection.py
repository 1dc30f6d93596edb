"""Selection of the density's parameters on calibration objects.

The likelihood prefers densities with sharp rows at rare estimates, which an argmin then picks. So
densities are cross-validated by the two-view error of their decisions; the maximum likelihood
serves for comparison. Test objects are never used.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import nearest_bin
from nbv.core.circle.evidence import (
    COARSE_BINS,
    Evidence,
    gather_evidence,
)
from nbv.core.circle.lookup import CostTable, build_lookup
from nbv.core.circle.policies import HeldOutViews, two_views
from nbv.errors import UserError

log = logging.getLogger(__name__)

DENSITY: Mapping[str, Any] = {
    "pose_likelihood": "given_estimate",
    "spread": "entropy",
    "bandwidths_deg": [4, 6, 8, 12, 16],
    "pseudo_observations": [3, 10, 30, 100],
    "n_parts": 5,
    "travel_cost": 0.0,
    "max_travel_deg": 180.0,
}
"""Settings of the paper's lookup tables; the defaults of ``density`` and ``recommendation``."""

AFFINITY: Mapping[str, float] = {"power": 16.0, "pseudo_observations": 90.0}
"""Settings of the expected error given a distribution; the defaults of ``affinity``.

A calibration view counts by the affinity of its distribution with the image's, to this power. So
many pseudo-observations (one-degree views of affinity 1) shrink the error towards the mean over all
views. Both were chosen on objects of other seeds (docs/method.md)."""

Candidate = tuple[float, float]
"""A bandwidth (degrees) and a number of pseudo-observations."""


@dataclass(frozen=True)
class DensityParams:
    """Parameters of a density, and their cross-validated errors.

    Attributes
    ----------
    bandwidth_deg, pseudo_observations : float
    candidate_error_deg : mapping
        Two-view error of each candidate; empty without a comparison.
    object_error_deg : tuple of float
        Error of the best candidate on each calibration object; empty without a comparison.
    """

    bandwidth_deg: float
    pseudo_observations: float
    candidate_error_deg: Mapping[Candidate, float] = field(default_factory=dict)
    object_error_deg: tuple[float, ...] = ()

    @property
    def error_deg(self) -> float:
        """The cross-validated error, NaN without a comparison."""
        candidate = (self.bandwidth_deg, self.pseudo_observations)
        return self.candidate_error_deg.get(candidate, float("nan"))


def _candidates(settings: Mapping[str, Any]) -> list[Candidate]:
    """Return the pairs of ``bandwidths_deg`` and ``pseudo_observations``, the widest first."""
    pairs = itertools.product(settings["bandwidths_deg"], settings["pseudo_observations"])
    return sorted(pairs, reverse=True)


def _trials(
    estimate_deg: NDArray[np.float64],
    settings: Mapping[str, Any],
    n_bins: int,
    shared: DensityParams | None = None,
) -> Iterator[tuple[Candidate, int, NDArray[np.bool_], Evidence]]:
    """Yield candidate, part, the mask of its objects, and the evidence of all other objects.

    The widest candidate comes first. Nothing is yielded for a single candidate or object.
    """
    candidates = _candidates(settings)
    n_objects = len(estimate_deg)
    parts = min(settings["n_parts"], n_objects)
    if len(candidates) == 1 or parts < 2:
        return
    part_of = np.arange(n_objects) % parts
    for candidate, part in itertools.product(candidates, range(parts)):
        others, density = estimate_deg[part_of != part], DensityParams(*candidate)
        evidence = chosen_evidence(others, shared or density, settings, n_bins, density)
        yield candidate, part, part_of == part, evidence


def choose_densities(
    estimate_deg: NDArray[np.float64],
    methods: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
    *,
    n_bins: int = COARSE_BINS,
    shared: DensityParams | None = None,
) -> dict[str, DensityParams]:
    """Choose a density for each of several methods, by cross-validation of their decisions.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    methods : mapping
        ``policy`` (a name in `nbv.core.circle.policies.POLICIES`) and ``fusion`` of each method.
    settings : mapping
        The configuration's ``density``. Candidates are all pairs of its ``bandwidths_deg`` and
        ``pseudo_observations``. The objects are divided into ``n_parts`` (every n-th object), or
        as many parts as objects.
    n_bins : int
        Bins of the tables compared.
    shared : DensityParams, optional
        Parameters of V and L; candidates then differ in the kernel of ``expected_error`` alone.

    Returns
    -------
    dict of str to DensityParams
        For each method the candidate of least mean error; among equals, the largest bandwidth and
        then the most pseudo-observations. A single object takes the widest candidate.

    Raises
    ------
    UserError
        If an error is not finite.
    """
    errors: dict[str, dict[Candidate, NDArray[np.float64]]] = {name: {} for name in methods}
    for candidate, part, held_out, evidence in _trials(estimate_deg, settings, n_bins, shared):
        for name, method in methods.items():
            # Every candidate gets the same random numbers.
            views = HeldOutViews(estimate_deg[held_out], evidence, np.random.default_rng(part))
            error = two_views(method["policy"], method["fusion"], views).error_deg
            object_errors = errors[name].setdefault(candidate, np.empty(len(estimate_deg)))
            object_errors[held_out] = error.mean(axis=1)
    widest = DensityParams(*_candidates(settings)[0])
    return {name: _best(name, trials) if trials else widest for name, trials in errors.items()}


def _best(name: str, errors: Mapping[Candidate, NDArray[np.float64]]) -> DensityParams:
    mean = {candidate: float(values.mean()) for candidate, values in errors.items()}
    for (bandwidth_deg, pseudo_observations), error_deg in mean.items():
        if not np.isfinite(error_deg):
            raise UserError(
                f"{name}: the two-view error with a bandwidth of {bandwidth_deg:g} deg and "
                f"{pseudo_observations:g} pseudo-observations is {error_deg}: the estimates are "
                "damaged; make them again"
            )
    best = min(mean, key=mean.__getitem__)
    log.info(
        "%s: bandwidth %g deg, %g pseudo-observations (two-view error %.2f deg; worst %.2f)",
        name,
        *best,
        mean[best],
        max(mean.values()),
    )
    return DensityParams(
        *best, candidate_error_deg=mean, object_error_deg=tuple(errors[best].tolist())
    )


def most_likely_density(
    estimate_deg: NDArray[np.float64], settings: Mapping[str, Any], *, n_bins: int = COARSE_BINS
) -> DensityParams:
    """Choose a density by the cross-validated log-likelihood of viewpoints given estimates.

    Same parameters as `choose_densities`; among equals, the widest candidate wins.
    """
    n_views = estimate_deg.shape[1]
    azimuth = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_bins)
    likelihood = dict.fromkeys(_candidates(settings), 0.0)
    for candidate, _, held_out, evidence in _trials(estimate_deg, settings, n_bins):
        rows = nearest_bin(estimate_deg[held_out], n_bins)
        p = evidence.conditionals.viewpoint[rows, azimuth]
        likelihood[candidate] += np.log(np.maximum(p, np.finfo(float).tiny)).sum()
    return DensityParams(*max(likelihood, key=likelihood.__getitem__))


def chosen_evidence(
    estimate_deg: NDArray[np.float64],
    density: DensityParams,
    settings: Mapping[str, Any],
    n_bins: int = 360,
    kernel: DensityParams | None = None,
) -> Evidence:
    """Gather evidence with a density's parameters, and `kernel` for ``expected_error`` if given."""
    evidence = gather_evidence(
        estimate_deg,
        settings,
        bandwidth_deg=density.bandwidth_deg,
        pseudo_observations=density.pseudo_observations,
        n_bins=n_bins,
    )
    if kernel is None:
        return evidence
    return replace(
        evidence,
        bandwidth_deg=kernel.bandwidth_deg,
        pseudo_observations=kernel.pseudo_observations,
    )


def chosen_lookup(
    estimate_deg: NDArray[np.float64], criterion: str, settings: Mapping[str, Any]
) -> CostTable:
    """Return `build_lookup` with the best density for fusion by averages."""
    method = {"policy": criterion, "fusion": "average"}
    density = choose_densities(estimate_deg, {criterion: method}, settings)[criterion]
    return build_lookup(chosen_evidence(estimate_deg, density, settings), criterion)

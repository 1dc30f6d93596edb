"""Choosing the density's smoothing and pseudo-observations by the decisions they lead to.

The density's own likelihood prefers sharp rows where estimates hardly ever occur, and an argmin
finds just those. So each candidate is judged by the two-view error of its decisions on
calibration objects that its tables were not built from; test objects are never seen. What the
likelihood would have chosen is there for comparison.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin
from nbv.core.evidence import Evidence, gather_evidence
from nbv.core.lookup import LookupTable, build_lookup
from nbv.core.policies import Turns, two_views
from nbv.errors import UserError

log = logging.getLogger(__name__)

# Bins of the tables compared. Fewer than of the final ones changes no choice among bandwidths
# well above 3 degrees, and costs 27 times less.
COARSE_BINS = 120

Candidate = tuple[float, float]
"""A bandwidth (degrees) and a number of pseudo-observations."""


@dataclass(frozen=True)
class Choice:
    """The density settings chosen, and the errors that decided.

    Attributes
    ----------
    bandwidth_deg, pseudo_observations : float
    candidate_error_deg : mapping
        Cross-validated two-view error of each candidate; empty where none was compared.
    object_error_deg : tuple of float
        That of the chosen candidate on each calibration object, or empty.
    """

    bandwidth_deg: float
    pseudo_observations: float
    candidate_error_deg: Mapping[Candidate, float] = field(default_factory=dict)
    object_error_deg: tuple[float, ...] = ()

    @property
    def error_deg(self) -> float:
        """The cross-validated error of what was chosen, NaN where nothing was compared."""
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
    shared: Choice | None = None,
) -> Iterator[tuple[Candidate, int, NDArray[np.bool_], Evidence]]:
    """Yield candidate, part, which objects are of that part, and the evidence of all others.

    The widest candidate comes first. One candidate alone, or one object, makes no trial.
    """
    candidates = _candidates(settings)
    n_objects = len(estimate_deg)
    parts = min(settings["n_parts"], n_objects)
    if len(candidates) == 1 or parts < 2:
        return
    part_of = np.arange(n_objects) % parts
    for candidate, part in itertools.product(candidates, range(parts)):
        others, choice = estimate_deg[part_of != part], Choice(*candidate)
        evidence = chosen_evidence(others, shared or choice, settings, n_bins)
        if shared is not None:
            evidence = with_kernel(evidence, choice)
        yield candidate, part, part_of == part, evidence


def choose_densities(
    estimate_deg: NDArray[np.float64],
    methods: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
    *,
    n_bins: int = COARSE_BINS,
    shared: Choice | None = None,
) -> dict[str, Choice]:
    """Cross-validate the decisions of several methods over calibration objects.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    methods : mapping
        ``policy`` (a name in `nbv.core.policies.POLICIES`) and ``fusion`` by name.
    settings : mapping
        The configuration's ``density``. Candidates are all pairs of its ``bandwidths_deg`` and
        ``pseudo_observations``; where there is but one, nothing is computed. The objects are
        divided into ``n_parts`` (every n-th object), fewer where there are fewer objects; one
        object alone cannot be cross-validated, and the widest candidate is taken.
    n_bins : int
        Of the tables compared.
    shared : Choice, optional
        Of V and L; then candidates differ in the kernel of ``expected_error`` alone.

    Returns
    -------
    dict of str to Choice
        For each method the candidate of least mean error; of equals, the largest bandwidth and
        then the most pseudo-observations.

    Raises
    ------
    UserError
        Where an error is not finite: NaN would be chosen, as nothing is less.
    """
    errors: dict[str, dict[Candidate, NDArray[np.float64]]] = {name: {} for name in methods}
    for candidate, part, held_out, evidence in _trials(estimate_deg, settings, n_bins, shared):
        for name, method in methods.items():
            # The same draws for every candidate.
            turns = Turns(estimate_deg[held_out], evidence, np.random.default_rng(part))
            error = two_views(method["policy"], method["fusion"], turns).error_deg
            of_objects = errors[name].setdefault(candidate, np.empty(len(estimate_deg)))
            of_objects[held_out] = error.mean(axis=1)
    widest = Choice(*_candidates(settings)[0])
    return {name: _best(name, tried) if tried else widest for name, tried in errors.items()}


def _best(name: str, errors: Mapping[Candidate, NDArray[np.float64]]) -> Choice:
    mean = {candidate: float(of_objects.mean()) for candidate, of_objects in errors.items()}
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
    return Choice(*best, candidate_error_deg=mean, object_error_deg=tuple(errors[best].tolist()))


def most_likely_density(
    estimate_deg: NDArray[np.float64], settings: Mapping[str, Any], *, n_bins: int = COARSE_BINS
) -> Choice:
    """Cross-validate the log-likelihood of V over calibration objects.

    Parameters as in `choose_densities`. The choice is the candidate under which held-out viewpoints
    are likeliest given their estimates, of equals the widest; no two-view error is known of it.
    """
    n_views = estimate_deg.shape[1]
    azimuth = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_bins)
    found = dict.fromkeys(_candidates(settings), 0.0)
    for candidate, _, held_out, evidence in _trials(estimate_deg, settings, n_bins):
        rows = nearest_bin(estimate_deg[held_out], n_bins)
        chance = evidence.conditionals.viewpoint[rows, azimuth]
        found[candidate] += np.log(np.maximum(chance, np.finfo(float).tiny)).sum()
    return Choice(*max(found, key=found.__getitem__))


def chosen_evidence(
    estimate_deg: NDArray[np.float64],
    choice: Choice,
    settings: Mapping[str, Any],
    n_bins: int = 360,
) -> Evidence:
    """Return `gather_evidence` of calibration estimates with the density settings chosen."""
    return gather_evidence(
        estimate_deg,
        settings,
        bandwidth_deg=choice.bandwidth_deg,
        pseudo_observations=choice.pseudo_observations,
        n_bins=n_bins,
    )


def with_kernel(evidence: Evidence, choice: Choice) -> Evidence:
    """Return the same V and L with another kernel and shrinkage for ``expected_error``."""
    return replace(
        evidence,
        bandwidth_deg=choice.bandwidth_deg,
        pseudo_observations=choice.pseudo_observations,
        made={},
    )


def chosen_lookup(
    estimate_deg: NDArray[np.float64], criterion: str, settings: Mapping[str, Any]
) -> LookupTable:
    """Return `build_lookup` with the density settings of `choose_densities`, fused by averages."""
    method = {"policy": criterion, "fusion": "average"}
    choice = choose_densities(estimate_deg, {criterion: method}, settings)[criterion]
    return build_lookup(chosen_evidence(estimate_deg, choice, settings), criterion)

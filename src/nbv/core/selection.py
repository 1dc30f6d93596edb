"""Selection on calibration objects: the density's parameters, and a policy with its fusion.

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

from nbv.core.angles import nearest_bin
from nbv.core.criteria import CRITERIA, FOR_ESTIMATES
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import (
    COARSE_BINS,
    Evidence,
    evidence_of_distributions,
    gather_evidence,
)
from nbv.core.fusion import ESTIMATE_FUSIONS, FUSIONS, OF_DISTRIBUTIONS
from nbv.core.lookup import CostTable, build_lookup
from nbv.core.policies import ORACLE, POLICIES, SINGLE, HeldOutViews, needs_lookup, two_views
from nbv.errors import UserError, nearest

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
"""Settings of the expected error given a distribution; the defaults of ``affinity``."""

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
        ``policy`` (a name in `nbv.core.policies.POLICIES`) and ``fusion`` of each method.
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


SELECTED = "selected"
"""As a policy or a fusion: that of the method selected on calibration objects."""

OPPOSITE = {"policy": "opposite", "fusion": "average"}
"""The paper's baseline: the most cautious candidate."""

NO_DENSITY = DensityParams(float("nan"), float("nan"))
"""For methods that fuse distributions."""

Methods = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class SelectedMethod:
    """An extension, calibrated on one fold.

    Attributes
    ----------
    policy, fusion : str
        Resolved names; never `SELECTED`.
    density : DensityParams
    evidence : Evidence
        Evidence from all calibration objects with this density.
    lookup : CostTable or None
        None for a policy without a table.
    """

    policy: str
    fusion: str
    density: DensityParams
    evidence: Evidence
    lookup: CostTable | None


def check_methods(methods: Methods, extensions: Methods, gives_distributions: bool) -> None:
    """Check a configuration's methods of the paper and its extensions, a policy and a fusion each.

    Raises
    ------
    UserError
        If a policy or a fusion is unknown or not possible, or an extension's name is taken.
    """
    for name, method in methods.items():
        key = f"methods.{name}"
        _check_names(key, method)
        if method["policy"] == ORACLE or method["fusion"] != "average":
            raise UserError(f"{key}: oracles and fusion other than average belong under extensions")
    taken = {*methods, *(method["policy"] for method in methods.values())}
    for name, method in extensions.items():
        key, policy, fusion = f"extensions.{name}", method["policy"], method["fusion"]
        if name in taken:
            raise UserError(f"{key}: the name is taken by a method; choose another")
        _check_names(key, {k: v for k, v in method.items() if v != SELECTED})
        if policy == SINGLE:
            raise UserError(f"{key}.policy={SINGLE}: it takes no second view")
        if SELECTED in (policy, fusion) and not _selectable(extensions):
            raise UserError(f"{key}: no extension can be selected")
        if fusion in OF_DISTRIBUTIONS:
            _check_distributions(key, method, gives_distributions)
        elif policy == ORACLE and fusion == "posterior":
            policies = {m["policy"] for m in extensions.values() if m["fusion"] == fusion}
            if policies <= {ORACLE, SELECTED}:
                raise UserError(f"{key}: no other extension fuses by {fusion}")


def _check_names(key: str, method: Mapping[str, Any]) -> None:
    if "policy" in method:
        try:
            needs_lookup(method["policy"])
        except UserError as error:
            raise UserError(f"{key}: {error}") from error
    if method.get("fusion", "average") not in FUSIONS:
        given = f"{key}.fusion={method['fusion']}"
        raise UserError(f"{given} is unknown: {nearest(method['fusion'], FUSIONS)}")


def _check_distributions(key: str, method: Mapping[str, Any], gives_distributions: bool) -> None:
    policy, fusion = method["policy"], method["fusion"]
    if not gives_distributions:
        raise UserError(
            f"{key}.fusion={fusion}: this estimator gives no distributions of the azimuth; "
            "choose estimator=classifier, which does"
        )
    if policy in (SELECTED, *FOR_ESTIMATES):
        known = [name for name in POLICIES if name not in FOR_ESTIMATES]
        raise UserError(
            f"{key}.policy={policy}: it is not defined for distributions; choose {', '.join(known)}"
        )


def _selectable(extensions: Methods) -> list[str]:
    """Return the extensions that can be selected: Opposite or a criterion, fusing estimates."""
    return [
        name
        for name, method in extensions.items()
        if method["policy"] in ("opposite", *CRITERIA) and method["fusion"] in ESTIMATE_FUSIONS
    ]


def select_methods(
    calibration: Estimates,
    extensions: Methods,
    settings: Mapping[str, Any],
    posteriors: Posteriors | None = None,
) -> dict[str, SelectedMethod]:
    """Choose each extension's density and build its table from calibration objects.

    Parameters
    ----------
    calibration : Estimates
        Estimates for objects that the estimator was not trained on.
    extensions : mapping
        ``policy`` and ``fusion`` of each extension; either may be `SELECTED`: that of the first
        candidate whose cross-validated error is not significantly above the least. Candidates are
        the paper's Opposite, then Opposite and criteria in the order of the extensions.
    settings : mapping
        The configuration's ``density`` and ``recommendation``.
    posteriors : Posteriors, optional
        The calibration objects' distributions: the evidence of extensions that fuse distributions,
        which have no density and are not candidates.
    """
    estimate_deg = calibration.estimate_deg
    own = {n: m for n, m in extensions.items() if m["fusion"] not in OF_DISTRIBUTIONS}
    resolved, densities = _resolve(estimate_deg, own, settings)
    evidences: dict[tuple[float, float], Evidence] = {}
    image_evidence = None
    if posteriors is not None:
        image_evidence = evidence_of_distributions(posteriors.distributions, settings)
    selected = {}
    for name, method in {**extensions, **resolved}.items():
        policy, fusion, lookup = method["policy"], method["fusion"], None
        density, evidence = densities.get(name, NO_DENSITY), image_evidence
        if name in resolved:
            key = (density.bandwidth_deg, density.pseudo_observations)
            if key not in evidences:
                evidences[key] = chosen_evidence(estimate_deg, density, settings)
            evidence = evidences[key]
            lookup = build_lookup(evidence, policy, fusion) if needs_lookup(policy) else None
        if evidence is None:
            raise ValueError(f"extension {name!r} needs posteriors")
        selected[name] = SelectedMethod(policy, fusion, density, evidence, lookup)
    return selected


def _resolve(
    estimate_deg: NDArray[np.float64], extensions: Methods, settings: Mapping[str, Any]
) -> tuple[dict[str, Mapping[str, Any]], dict[str, DensityParams]]:
    """Return each extension's policy and fusion without `SELECTED`, and its density."""
    open_names = [name for name, method in extensions.items() if SELECTED in method.values()]
    bounds = [n for n, m in extensions.items() if n not in open_names and m["policy"] == ORACLE]
    own = {n: m for n, m in extensions.items() if n not in (*open_names, *bounds)}
    if (open_names or bounds) and OPPOSITE not in own.values():
        own = {"opposite (average)": OPPOSITE} | own
    densities = choose_densities(estimate_deg, own, settings)
    for name in bounds:
        fusion = extensions[name]["fusion"]
        same_fusion = [densities[n] for n, m in own.items() if m["fusion"] == fusion]
        # An oracle has no density; it takes that of the best method with the same fusion.
        densities[name] = min(same_fusion, key=lambda density: density.error_deg)
    if not open_names:
        return dict(extensions), densities
    winner = own[_most_cautious({name: densities[name] for name in _selectable(own)})]
    followers = {
        name: {key: winner[key] if value == SELECTED else value for key, value in method.items()}
        for name, method in extensions.items()
        if name in open_names
    }
    new = {n: m for n, m in followers.items() if m not in own.values()}
    densities |= choose_densities(estimate_deg, new, settings) if new else {}
    for name, method in followers.items():
        same = next(n for n, m in (own | new).items() if m == method)
        densities[name] = densities[same]
    return {**extensions, **followers}, densities


def _most_cautious(densities: Mapping[str, DensityParams]) -> str:
    """Return the first candidate, in the order given, that is not surely worse than the best.

    This is the rule of one standard error (Breiman et al., 1984): candidates that few calibration
    objects cannot distinguish are decided by the order of the configuration.
    """
    errors = [density.error_deg for density in densities.values()]
    if np.isnan(errors).any():
        return next(iter(densities))
    best = list(densities.values())[int(np.argmin(errors))]
    return next(n for n, density in densities.items() if not surely_better(best, density))


def surely_better(density: DensityParams, other: DensityParams) -> bool:
    """Return whether a validated error is below another one by more than a standard error.

    Errors are paired by calibration object. The standard error is scaled by Student's t to the
    probability of one standard error for many objects. False for fewer than two objects.
    """
    gaps = np.subtract(density.object_error_deg, other.object_error_deg)
    if gaps.size < 2:
        return False
    # An import of half a second, which only a choice among densities needs.
    from scipy import stats

    quantile = stats.t.ppf(stats.norm.cdf(1.0), gaps.size - 1)
    return bool(gaps.mean() < -quantile * gaps.std(ddof=1) / np.sqrt(gaps.size))

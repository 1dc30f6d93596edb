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
from scipy import stats

from nbv.core.angles import nearest_bin
from nbv.core.criteria import CRITERIA, FOR_ESTIMATES
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence, evidence_of_distributions, gather_evidence
from nbv.core.fusion import ESTIMATE_FUSIONS, FUSIONS, OF_DISTRIBUTIONS
from nbv.core.lookup import LookupTable, build_lookup
from nbv.core.policies import ORACLE, POLICIES, SINGLE, Turns, needs_lookup, two_views
from nbv.errors import UserError, nearest

log = logging.getLogger(__name__)

# Bins of the tables compared. Fewer than of the final ones changes no choice among bandwidths
# well above 3 degrees, and costs 27 times less.
COARSE_BINS = 120

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


SELECTED = "selected"
"""As a policy and a fusion: those of the pair that calibration objects favour."""

OPPOSITE = {"policy": "opposite", "fusion": "average"}
"""The paper's baseline: the most cautious candidate to be selected."""

NO_DENSITY = Choice(float("nan"), float("nan"))
"""Of methods that go by distributions of images."""

Methods = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class SelectedMethod:
    """One extension in one fold.

    Attributes
    ----------
    policy, fusion : str
        What it does; never `SELECTED`, but what was selected.
    choice : Choice
        Its density's settings.
    evidence : Evidence
        Made with them of all calibration objects.
    lookup : LookupTable or None
        None for a policy that follows no table.
    """

    policy: str
    fusion: str
    choice: Choice
    evidence: Evidence
    lookup: LookupTable | None


def check_methods(methods: Methods, extensions: Methods, gives_distributions: bool) -> None:
    """Check what a configuration says about the paper's methods and about extensions.

    Parameters
    ----------
    methods, extensions : mapping
        ``policy`` and ``fusion`` by name.
    gives_distributions : bool
        Whether the estimator gives p(azimuth | image).

    Raises
    ------
    UserError
        Where a policy or a fusion is unknown or cannot be had, or where an extension's name stands
        for something else already.
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
            raise UserError(f"{key}: there is none to be selected")
        if fusion in OF_DISTRIBUTIONS:
            _check_distributions(key, method, gives_distributions)
        elif policy == ORACLE and fusion == "posterior":
            alike = {m["policy"] for m in extensions.values() if m["fusion"] == fusion}
            if alike <= {ORACLE, SELECTED}:
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
    """Return the extensions that may be selected: Opposite or a criterion, fusing estimates."""
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
    """Choose each extension's density, and build its table, from calibration objects alone.

    Parameters
    ----------
    calibration : Estimates
        Of objects that the estimator was not trained on.
    extensions : mapping
        ``policy`` and ``fusion`` by name; either may be `SELECTED`: that of the first candidate
        whose cross-validated error is not surely above the least. Candidates are the paper's
        Opposite, then Opposite and criteria in the order of the extensions.
    settings : mapping
        The configuration's ``density`` and ``recommendation``.
    posteriors : Posteriors, optional
        The calibration objects' distributions, where an extension fuses distributions. They are
        its evidence; it has no density to choose and is no candidate.
    """
    estimate_deg = calibration.estimate_deg
    of_estimates = {n: m for n, m in extensions.items() if m["fusion"] not in OF_DISTRIBUTIONS}
    resolved, choices = _resolve(estimate_deg, of_estimates, settings)
    made: dict[tuple[float, float], Evidence] = {}
    of_distributions = None
    if posteriors is not None:
        of_distributions = evidence_of_distributions(posteriors.distributions, settings)
    selected = {}
    for name, method in {**extensions, **resolved}.items():
        policy, fusion, lookup = method["policy"], method["fusion"], None
        choice, evidence = choices.get(name, NO_DENSITY), of_distributions
        if name in resolved:
            key = (choice.bandwidth_deg, choice.pseudo_observations)
            if key not in made:
                made[key] = chosen_evidence(estimate_deg, choice, settings)
            evidence = made[key]
            lookup = build_lookup(evidence, policy, fusion) if needs_lookup(policy) else None
        if evidence is None:
            raise ValueError(f"extension {name!r} needs posteriors")
        selected[name] = SelectedMethod(policy, fusion, choice, evidence, lookup)
    return selected


def _resolve(
    estimate_deg: NDArray[np.float64], extensions: Methods, settings: Mapping[str, Any]
) -> tuple[dict[str, Mapping[str, Any]], dict[str, Choice]]:
    """Return each extension's policy and fusion, `SELECTED` replaced, and its density."""
    led = [name for name, method in extensions.items() if SELECTED in method.values()]
    bounds = [n for n, m in extensions.items() if n not in led and m["policy"] == ORACLE]
    own = {n: m for n, m in extensions.items() if n not in (*led, *bounds)}
    if (led or bounds) and OPPOSITE not in own.values():
        own = {"opposite (average)": OPPOSITE} | own
    choices = choose_densities(estimate_deg, own, settings)
    for name in bounds:
        fusion = extensions[name]["fusion"]
        alike = [choices[other] for other, method in own.items() if method["fusion"] == fusion]
        # An oracle chooses no density; it takes that of the best method that fuses alike.
        choices[name] = min(alike, key=lambda choice: choice.error_deg)
    if not led:
        return dict(extensions), choices
    winner = own[_first_not_surely_worse({name: choices[name] for name in _selectable(own)})]
    followers = {
        name: {key: winner[key] if value == SELECTED else value for key, value in method.items()}
        for name, method in extensions.items()
        if name in led
    }
    new = {n: m for n, m in followers.items() if m not in own.values()}
    choices |= choose_densities(estimate_deg, new, settings) if new else {}
    for name, method in followers.items():
        same = next(other for other, plain in (own | new).items() if plain == method)
        choices[name] = choices[same]
    return {**extensions, **followers}, choices


def _first_not_surely_worse(choices: Mapping[str, Choice]) -> str:
    """Return the first candidate, in the order given, that the best is not surely better than.

    The rule of one standard error (Breiman et al., 1984): what few calibration objects cannot
    tell apart is decided by the order of caution in which the configuration lists them.
    """
    errors = [choice.error_deg for choice in choices.values()]
    if np.isnan(errors).any():
        return next(iter(choices))
    best = list(choices.values())[int(np.argmin(errors))]
    return next(name for name, choice in choices.items() if not surely_better(best, choice))


def surely_better(one: Choice, other: Choice) -> bool:
    """Say whether one choice's validated error is below another's by more than a standard error.

    Paired by calibration object; the standard error counts by Student's t for so few objects, at
    the probability that one standard error has for many. Never with fewer than two objects.
    """
    gaps = np.subtract(one.object_error_deg, other.object_error_deg)
    if gaps.size < 2:
        return False
    quantile = stats.t.ppf(stats.norm.cdf(1.0), gaps.size - 1)
    return bool(gaps.mean() < -quantile * gaps.std(ddof=1) / np.sqrt(gaps.size))

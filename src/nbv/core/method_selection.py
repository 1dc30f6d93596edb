"""Extensions on equal terms: each with the density that serves it best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from nbv.core.criteria import CRITERIA, FOR_ESTIMATES
from nbv.core.density_selection import Choice, choose_densities, chosen_evidence
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence, evidence_of_distributions
from nbv.core.fusion import ESTIMATE_FUSIONS, FUSIONS, OF_DISTRIBUTIONS
from nbv.core.lookup import LookupTable, build_lookup
from nbv.core.policies import ORACLE, POLICIES, SINGLE, needs_lookup
from nbv.errors import UserError, nearest

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
        if SELECTED in (policy, fusion) and not _candidates(extensions):
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


def _candidates(extensions: Methods) -> list[str]:
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
    winner = own[_first_not_surely_worse({name: choices[name] for name in _candidates(own)})]
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

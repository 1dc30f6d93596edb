"""Selection of extensions on calibration objects: a density, a policy and a fusion for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.choose import is_surely_less
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.evidence import Evidence, evidence_of_distributions
from nbv.core.circle.fusion import OF_DISTRIBUTIONS
from nbv.core.circle.lookup import CostTable, build_lookup
from nbv.core.circle.policies import ORACLE, needs_lookup
from nbv.core.circle.selection import DensityParams, choose_densities, chosen_evidence
from nbv.experiment.methods import SELECTED, Methods, selectable

OPPOSITE = {"policy": "opposite", "fusion": "average"}
"""The paper's baseline: the most cautious candidate."""

NO_DENSITY = DensityParams(float("nan"), float("nan"))
"""For methods that fuse distributions."""


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
    of_estimates = {n: m for n, m in extensions.items() if m["fusion"] not in OF_DISTRIBUTIONS}
    resolved, densities = _resolve(estimate_deg, of_estimates, settings)
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
    candidates = {n: m for n, m in extensions.items() if n not in (*open_names, *bounds)}
    if (open_names or bounds) and OPPOSITE not in candidates.values():
        candidates = {"opposite (average)": OPPOSITE} | candidates
    densities = choose_densities(estimate_deg, candidates, settings)
    for name in bounds:
        fusion = extensions[name]["fusion"]
        same_fusion = [densities[n] for n, m in candidates.items() if m["fusion"] == fusion]
        # An oracle has no density; it takes that of the best method with the same fusion.
        densities[name] = min(same_fusion, key=lambda density: density.error_deg)
    if not open_names:
        return dict(extensions), densities
    winner = candidates[_most_cautious({name: densities[name] for name in selectable(candidates)})]
    followers = {
        name: {key: winner[key] if value == SELECTED else value for key, value in method.items()}
        for name, method in extensions.items()
        if name in open_names
    }
    new = {n: m for n, m in followers.items() if m not in candidates.values()}
    densities |= choose_densities(estimate_deg, new, settings) if new else {}
    for name, method in followers.items():
        same = next(n for n, m in (candidates | new).items() if m == method)
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
    return is_surely_less(gaps, float(quantile))

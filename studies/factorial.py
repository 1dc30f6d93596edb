"""Every choice of the next view with every fusion, on the same estimates of one fold.

Only a factorial design separates the effects of choice and fusion: the paper's method differs from
Opposite in the choice, but from its extensions in both. The average uses no density, so each choice
has its own best density. The posterior uses one, which all choices share; the regression of
``expected_error`` has its own kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.circle.criteria import POSE_LIKELIHOODS
from nbv.core.circle.estimates import Posteriors
from nbv.core.circle.evidence import COARSE_BINS, Evidence, evidence_of_distributions
from nbv.core.circle.fusion import ESTIMATE_FUSIONS
from nbv.core.circle.lookup import CostTable, build_lookup
from nbv.core.circle.policies import needs_lookup
from nbv.core.circle.selection import (
    DensityParams,
    choose_densities,
    chosen_evidence,
    most_likely_density,
)
from nbv.experiment.results import evaluate_method
from studies.curves import more_views_rows
from studies.kept_estimates import HeldOut

Pair = tuple[str, str]
"""A choice of the next view and a fusion."""

SINGLE: Final[Pair] = ("none", "none")
LIKELIEST: Final[Pair] = ("given_truth_likeliest", "average")
"""The weakest reading of the paper: T = L, the likeliest smoothing, no pseudo-observations."""
RANDOM_POSTERIOR: Final[Pair] = ("random", "posterior")
"""Its density is shared by all choices with the fusion ``posterior``."""

POLICIES: Final[Mapping[str, str]] = {
    "random": "random",
    "fixed": "fixed",
    "opposite": "opposite",
    "given_truth": "pose_ambiguity",
    "given_estimate": "pose_ambiguity",
    "through_estimate": "pose_ambiguity",
    "information_gain": "information_gain",
    "expected_dispersion": "expected_dispersion",
    "expected_error": "expected_error",
}
"""The policy of each choice; the pose ambiguity has three interpretations."""

CHOICES_WITH_TABLES = tuple(choice for choice, policy in POLICIES.items() if needs_lookup(policy))

METHODS: Final[Mapping[Pair, str]] = {
    (choice, fusion): policy for fusion in ESTIMATE_FUSIONS for choice, policy in POLICIES.items()
} | {LIKELIEST: "pose_ambiguity"}
"""The policies of all pairs that fuse estimates."""

PRODUCT_CHOICES = ("random", "fixed", "opposite", "information_gain", "expected_error")
"""Choices for the fusion ``product`` of images' distributions."""

MORE_VIEWS: Final[Mapping[str, Pair]] = {
    "random": ("random", "posterior"),
    "evenly_spaced": ("evenly_spaced", "posterior"),
    "information_gain": ("information_gain", "posterior"),
    "random_product": ("random", "product"),
    "evenly_spaced_product": ("evenly_spaced", "product"),
    "information_gain_product": ("information_gain", "product"),
}
"""Choice and fusion of the policies of `studies.curves` in the comparison."""

DENSITY_COLUMNS = (
    "choice",
    "fusion",
    "bandwidth_deg",
    "pseudo_observations",
    "pairs_percent",
    "validated_error_deg",
)

RngOf = Callable[[str], np.random.Generator]


@dataclass(frozen=True)
class Factorial:
    """Results for the test objects of one fold.

    Attributes
    ----------
    frames : dict of (choice, fusion) to DataFrame
        Rows of `nbv.experiment.results.evaluate_method` for two views, and for one (`SINGLE`).
    posterior_density : DensityParams
        The density that choices share with the fusion ``posterior``.
    densities : DataFrame
        The density of each choice and fusion, columns `DENSITY_COLUMNS`. ``pairs_percent`` is the
        mean share of calibration pairs in a row of V; the rest are pseudo-observations.
    """

    frames: dict[Pair, pd.DataFrame]
    posterior_density: DensityParams
    densities: pd.DataFrame


def evaluate_factorial(
    calibration: HeldOut,
    test: HeldOut,
    settings: Mapping[str, Any],
    rng_of: RngOf,
) -> Factorial:
    """Evaluate every choice of a second view with every fusion on the test objects of one fold.

    Tables have `COARSE_BINS` bins; estimates are fused with 360.

    Parameters
    ----------
    calibration, test : HeldOut
        With distributions, the fusion ``product`` and choices by an image's distribution are added,
        and first views are one class apart.
    settings : mapping
        The configuration's ``density``, ``recommendation`` and ``affinity``.
    rng_of : callable
        The generator of a choice, by name: random views are the same for all fusions of estimates.
    """
    estimate_deg, tested = calibration.estimates.estimate_deg, test.estimates
    densities = _densities(estimate_deg, settings)
    lookups = _lookups(estimate_deg, densities, settings)
    shared = densities[RANDOM_POSTERIOR]
    fine = chosen_evidence(estimate_deg, shared, settings)
    frames = {SINGLE: evaluate_method({"policy": "none", "fusion": "average"}, tested)}
    for (choice, fusion), policy in METHODS.items():
        method = {"policy": policy, "fusion": fusion}
        lookup = lookups.get((choice, fusion))
        frames[choice, fusion] = evaluate_method(method, tested, rng_of(choice), lookup, fine)
    if calibration.posteriors is not None and test.posteriors is not None:
        evidence = evidence_of_distributions(calibration.posteriors.distributions, settings)
        frames |= _product_frames(test, test.posteriors, evidence, rng_of)
        step = 360 // test.posteriors.distributions.shape[1]
        frames = {
            pair: frame[frame["initial_deg"] % step == 0].reset_index(drop=True)
            for pair, frame in frames.items()
        }
    return Factorial(frames, shared, _densities_frame(densities, estimate_deg.size / 360))


def _settings_of(choice: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a choice: the pose likelihood has three interpretations."""
    if choice == LIKELIEST[0]:
        return dict(settings) | {"pose_likelihood": "given_truth", "pseudo_observations": [0.0]}
    given = choice if choice in POSE_LIKELIHOODS else "given_estimate"
    return dict(settings) | {"pose_likelihood": given}


def _densities(
    estimate_deg: NDArray[np.float64], settings: Mapping[str, Any]
) -> dict[Pair, DensityParams]:
    """Choose the densities: one for each choice with averages, shared ones with posteriors."""

    def best(
        fusion: str, *choices: str, shared: DensityParams | None = None
    ) -> dict[Pair, DensityParams]:
        methods = {choice: {"policy": POLICIES[choice], "fusion": fusion} for choice in choices}
        of_choice = _settings_of(choices[0], settings)
        chosen = choose_densities(estimate_deg, methods, of_choice, shared=shared)
        return {(choice, fusion): density for choice, density in chosen.items()}

    apart = ("given_truth", "through_estimate")
    average = best("average", *(c for c in CHOICES_WITH_TABLES if c not in apart))
    for choice in apart:
        average |= best("average", choice)
    posterior = best("posterior", "random")
    kernel = best("posterior", "expected_error", shared=posterior[RANDOM_POSTERIOR])
    likeliest = most_likely_density(estimate_deg, _settings_of(LIKELIEST[0], settings))
    return average | posterior | kernel | {LIKELIEST: likeliest}


def _lookups(
    estimate_deg: NDArray[np.float64],
    densities: Mapping[Pair, DensityParams],
    settings: Mapping[str, Any],
) -> dict[Pair, CostTable]:
    """Build the coarse tables of all pairs whose policy has one."""
    lookups = {}
    for (choice, fusion), policy in METHODS.items():
        if not needs_lookup(policy):
            continue
        density = densities.get(("random", fusion)) or densities[choice, fusion]
        kernel = densities.get((choice, fusion), density)
        of_choice = _settings_of(choice, settings)
        evidence = chosen_evidence(estimate_deg, density, of_choice, COARSE_BINS, kernel)
        lookups[choice, fusion] = build_lookup(evidence, policy, fusion)
    return lookups


def _product_frames(
    test: HeldOut, posteriors: Posteriors, evidence: Evidence, rng_of: RngOf
) -> dict[Pair, pd.DataFrame]:
    return {
        (choice, "product"): evaluate_method(
            {"policy": POLICIES[choice], "fusion": "product"},
            test.estimates_of_posteriors,
            rng_of(choice),
            evidence=evidence,
            posteriors=posteriors,
        )
        for choice in PRODUCT_CHOICES
    }


def _densities_frame(densities: Mapping[Pair, DensityParams], pairs_per_row: float) -> pd.DataFrame:
    rows = []
    for pair, density in densities.items():
        alpha = density.pseudo_observations
        share = 100.0 * pairs_per_row / (pairs_per_row + alpha)
        rows.append((*pair, density.bandwidth_deg, alpha, share, density.error_deg))
    return pd.DataFrame(rows, columns=list(DENSITY_COLUMNS))


def evaluate_more_views(
    calibration: HeldOut,
    test: HeldOut,
    density: DensityParams,
    settings: Mapping[str, Any],
    more_views: Mapping[str, Any],
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return `studies.curves.more_views_rows` of the test objects of one fold.

    Parameters
    ----------
    calibration, test, settings
        The arguments of `evaluate_factorial`.
    density : DensityParams
        Its `Factorial.posterior_density`.
    more_views : mapping
        The configuration's ``more_views``.
    rng : numpy.random.Generator
    """
    evidence = cache(
        partial(chosen_evidence, calibration.estimates.estimate_deg, density, settings)
    )
    evidences: dict[str, Callable[[int], Evidence]] = dict.fromkeys(
        ("random", "opposite", "information_gain"), evidence
    )
    image_evidence = None
    if calibration.posteriors is not None:
        image_evidence = evidence_of_distributions(calibration.posteriors.distributions, settings)
    return more_views_rows(
        test.estimates, evidences, more_views, rng, test.posteriors, image_evidence
    )

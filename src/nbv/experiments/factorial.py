"""Every choice of the next view with every fusion, on the same estimates of one fold.

A choice and a fusion are told apart only where both vary: the paper's method differs from Opposite
in the choice, and from its extensions in both. All choices with the same fusion share its density,
so that they differ in nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.experiments.kept_estimates import HeldOut
from nbv.experiments.more_views import more_views_rows
from nbv.experiments.two_views import evaluate_method
from nbv.recommendation.density_selection import (
    COARSE_BINS,
    Choice,
    choose_densities,
    chosen_evidence,
    most_likely_density,
)
from nbv.recommendation.evidence import Evidence, evidence_of_distributions
from nbv.recommendation.fusion import ESTIMATE_FUSIONS
from nbv.recommendation.lookup import build_lookup
from nbv.recommendation.policies import needs_lookup

Pair = tuple[str, str]
"""A choice of the next view and a fusion."""

SINGLE: Final[Pair] = ("none", "none")
AS_PRINTED: Final[Pair] = ("as_printed", "average")
"""The paper's method as it reads: T = L, the likeliest smoothing, no pseudo-observations."""

POLICIES: Final[Mapping[str, str]] = {
    "random": "random",
    "fixed": "fixed",
    "opposite": "opposite",
    "given_truth": "pose_ambiguity",
    "given_estimate": "pose_ambiguity",
    "information_gain": "information_gain",
    "expected_dispersion": "expected_dispersion",
    "expected_error": "expected_error",
}
"""The policy of each choice; the pose ambiguity has two interpretations."""

BY_POSE_LIKELIHOOD: Final[Mapping[str, tuple[str, ...]]] = {
    "given_estimate": tuple(choice for choice in POLICIES if choice != "given_truth"),
    "given_truth": ("given_truth",),
}
"""The choices under each interpretation of the pose likelihood; it concerns the ambiguity alone."""

OF_IMAGES = ("random", "fixed", "opposite", "information_gain", "expected_error")
"""Choices that are defined where images give distributions, which are fused by product."""

DECIDED_BY: Final[Mapping[str, str]] = {"average": "pose_ambiguity", "posterior": "random"}
"""The policy whose errors decide on a fusion's density: the paper's, or one without a table."""

MORE_VIEWS: Final[Mapping[str, Pair]] = {
    "random": ("random", "posterior"),
    "evenly_spaced": ("evenly_spaced", "posterior"),
    "information_gain": ("information_gain", "posterior"),
    "random_product": ("random", "product"),
    "evenly_spaced_product": ("evenly_spaced", "product"),
    "information_gain_product": ("information_gain", "product"),
    "expected_error_product": ("expected_error", "product"),
}
"""Choice and fusion of the policies of `nbv.experiments.more_views` that are compared."""

DENSITY_COLUMNS = (
    "density",
    "bandwidth_deg",
    "pseudo_observations",
    "pairs_percent",
    "validated_error_deg",
)

RngOf = Callable[[str], np.random.Generator]


@dataclass(frozen=True)
class Factorial:
    """What became of the test objects of one fold.

    Attributes
    ----------
    frames : dict of (choice, fusion) to DataFrame
        Two views, and one (`SINGLE`); as of `nbv.experiments.two_views.evaluate_method`.
    more_views : DataFrame
        As of `nbv.experiments.more_views.more_views_rows`.
    densities : DataFrame
        What calibration objects chose for each fusion and for `AS_PRINTED`; `DENSITY_COLUMNS`.
        ``pairs_percent`` is the mean share of calibration pairs in a row of V, whose other part are
        uniform pseudo-observations.
    """

    frames: dict[Pair, pd.DataFrame]
    more_views: pd.DataFrame
    densities: pd.DataFrame


def evaluate_factorial(
    calibration: HeldOut,
    test: HeldOut,
    settings: Mapping[str, Any],
    more_views: Mapping[str, Any],
    rng_of: RngOf,
) -> Factorial:
    """Evaluate every choice with every fusion on the test objects of one fold.

    Tables that choose have `COARSE_BINS` bins; estimates are fused with 360.

    Parameters
    ----------
    calibration, test : HeldOut
        Where they have distributions, the fusion ``product`` and choices by an image's own
        distribution are added, from first views that are a class apart.
    settings : mapping
        The configuration's ``density``, ``recommendation`` and ``affinity``.
    more_views : mapping
        The configuration's ``more_views``.
    rng_of : callable
        The generator of a choice, by name: random views are the same under every fusion.
    """
    known, tested = calibration.estimates.estimate_deg, test.estimates
    densities = _densities(known, settings)
    frames = {SINGLE: evaluate_method({"policy": "none", "fusion": "average"}, tested)}
    for fusion in ESTIMATE_FUSIONS:
        frames |= _estimate_frames(fusion, densities[fusion], known, tested, settings, rng_of)
    printed = dict(settings) | {"pose_likelihood": "given_truth", "pseudo_observations": [0.0]}
    densities["as_printed"] = most_likely_density(known, printed)
    coarse = chosen_evidence(known, densities["as_printed"], printed, COARSE_BINS)
    table = build_lookup(coarse, POLICIES["given_truth"])
    method = {"policy": POLICIES["given_truth"], "fusion": "average"}
    frames[AS_PRINTED] = evaluate_method(method, tested, lookup=table)
    of_images = None
    if calibration.posteriors is not None and test.posteriors is not None:
        of_images = evidence_of_distributions(calibration.posteriors.distributions, settings)
        frames |= _product_frames(test, test.posteriors, of_images, rng_of)
    evidence = cache(partial(chosen_evidence, known, densities["posterior"], settings))
    evidences: dict[str, Callable[[int], Evidence]] = dict.fromkeys(
        ("random", "opposite", "information_gain"), lambda n_bins: evidence(n_bins=n_bins)
    )
    rows = more_views_rows(
        tested, evidences, more_views, rng_of("more_views"), test.posteriors, of_images
    )
    return Factorial(frames, rows, _densities_frame(densities, known.size / 360))


def _estimate_frames(
    fusion: str,
    density: Choice,
    calibration_deg: NDArray[np.float64],
    test: Estimates,
    settings: Mapping[str, Any],
    rng_of: RngOf,
) -> dict[Pair, pd.DataFrame]:
    """Return the frame of every choice with one fusion of estimates."""
    frames = {}
    for pose_likelihood, choices in BY_POSE_LIKELIHOOD.items():
        own = dict(settings) | {"pose_likelihood": pose_likelihood}
        coarse, fine = (
            chosen_evidence(calibration_deg, density, own, n_bins) for n_bins in (COARSE_BINS, 360)
        )
        for choice in choices:
            policy = POLICIES[choice]
            lookup = build_lookup(coarse, policy, fusion) if needs_lookup(policy) else None
            method = {"policy": policy, "fusion": fusion}
            frames[choice, fusion] = evaluate_method(method, test, rng_of(choice), lookup, fine)
    return frames


def _densities(estimate_deg: NDArray[np.float64], settings: Mapping[str, Any]) -> dict[str, Choice]:
    methods = {
        fusion: {"policy": DECIDED_BY[fusion], "fusion": fusion} for fusion in ESTIMATE_FUSIONS
    }
    return choose_densities(estimate_deg, methods, settings)


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
        for choice in OF_IMAGES
    }


def _densities_frame(densities: Mapping[str, Choice], pairs_of_row: float) -> pd.DataFrame:
    rows = []
    for name, choice in densities.items():
        alpha = choice.pseudo_observations
        share = 100.0 * pairs_of_row / (pairs_of_row + alpha)
        rows.append((name, choice.bandwidth_deg, alpha, share, choice.error_deg))
    return pd.DataFrame(rows, columns=list(DENSITY_COLUMNS))

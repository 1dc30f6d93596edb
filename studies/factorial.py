"""Every choice of the next view with every fusion, on the same estimates of one fold.

The effects of choice and fusion separate only where both vary: the paper's method differs from
Opposite in the choice, and from its extensions in both. All choices with the same fusion fuse
alike. An average needs no density, so each choice has the density that is best for it. A posterior
needs one, which all choices share; the regression of ``expected_error`` has its own kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence, evidence_of_distributions
from nbv.core.fusion import ESTIMATE_FUSIONS
from nbv.core.lookup import build_lookup
from nbv.core.policies import needs_lookup
from nbv.core.selection import (
    COARSE_BINS,
    Choice,
    choose_densities,
    chosen_evidence,
    most_likely_density,
    with_kernel,
)
from nbv.experiment.results import evaluate_method
from studies.curves import more_views_rows
from studies.kept_estimates import HeldOut

Pair = tuple[str, str]
"""A choice of the next view and a fusion."""

SINGLE: Final[Pair] = ("none", "none")
AS_PRINTED: Final[Pair] = ("as_printed", "average")
"""The paper's method as printed: T = L, smoothing by likelihood, no pseudo-observations."""

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
"""The policies by choice; the pose ambiguity has two interpretations."""

CHOICES_WITH_TABLES = tuple(choice for choice, policy in POLICIES.items() if needs_lookup(policy))
REGRESSION = "expected_error"

PRODUCT_CHOICES = ("random", "fixed", "opposite", "information_gain", "expected_error")
"""The choices for distributions of images, which are fused by product."""

MORE_VIEWS: Final[Mapping[str, Pair]] = {
    "random": ("random", "posterior"),
    "evenly_spaced": ("evenly_spaced", "posterior"),
    "information_gain": ("information_gain", "posterior"),
    "random_product": ("random", "product"),
    "evenly_spaced_product": ("evenly_spaced", "product"),
    "information_gain_product": ("information_gain", "product"),
    "expected_error_product": ("expected_error", "product"),
}
"""Choice and fusion of the compared policies of `studies.curves`."""

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
    """The results on the test objects of one fold.

    Attributes
    ----------
    frames : dict of (choice, fusion) to DataFrame
        Frames of `nbv.experiment.results.evaluate_method`: two views, and one (`SINGLE`).
    more_views : DataFrame
        Rows of `studies.curves.more_views_rows`.
    densities : DataFrame
        The selected densities by choice and fusion; `DENSITY_COLUMNS`. ``pairs_percent`` is the
        mean share of calibration pairs in a row of V; the rest are uniform pseudo-observations.
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

    Lookup tables have `COARSE_BINS` bins; estimates are fused with 360.

    Parameters
    ----------
    calibration, test : HeldOut
        If they have distributions, the fusion ``product`` and choices by an image's distribution
        are added, for first views that are a class apart.
    settings : mapping
        The configuration's ``density``, ``recommendation`` and ``affinity``.
    more_views : mapping
        The configuration's ``more_views``.
    rng_of : callable
        Returns the generator of a choice, by name: random views are the same for every fusion of
        estimates.
    """
    known, tested = calibration.estimates.estimate_deg, test.estimates
    densities: dict[Pair, Choice] = {}
    frames = {SINGLE: evaluate_method({"policy": "none", "fusion": "average"}, tested)}
    for fusion in ESTIMATE_FUSIONS:
        chosen = _densities(fusion, known, settings)
        densities |= {(choice, fusion): density for choice, density in chosen.items()}
        frames |= _estimate_frames(fusion, chosen, known, tested, settings, rng_of)
    printed = _choice_settings("given_truth", settings) | {"pseudo_observations": [0.0]}
    densities[AS_PRINTED] = most_likely_density(known, printed)
    coarse = chosen_evidence(known, densities[AS_PRINTED], printed, COARSE_BINS)
    table = build_lookup(coarse, POLICIES["given_truth"])
    method = {"policy": POLICIES["given_truth"], "fusion": "average"}
    frames[AS_PRINTED] = evaluate_method(method, tested, lookup=table)
    image_evidence = None
    if calibration.posteriors is not None and test.posteriors is not None:
        image_evidence = evidence_of_distributions(calibration.posteriors.distributions, settings)
        frames |= _product_frames(test, test.posteriors, image_evidence, rng_of)
        step = 360 // test.posteriors.distributions.shape[1]
        frames = {
            pair: frame[frame["initial_deg"] % step == 0].reset_index(drop=True)
            for pair, frame in frames.items()
        }
    shared = densities["random", "posterior"]
    evidence = cache(partial(chosen_evidence, known, shared, settings))
    evidences: dict[str, Callable[[int], Evidence]] = dict.fromkeys(
        ("random", "opposite", "information_gain"), lambda n_bins: evidence(n_bins=n_bins)
    )
    rows = more_views_rows(
        tested, evidences, more_views, rng_of("more_views"), test.posteriors, image_evidence
    )
    return Factorial(frames, rows, _densities_frame(densities, known.size / 360))


def _choice_settings(choice: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a choice, with its interpretation of the pose likelihood."""
    given = "given_truth" if choice == "given_truth" else "given_estimate"
    return dict(settings) | {"pose_likelihood": given}


def _densities(
    fusion: str, estimate_deg: NDArray[np.float64], settings: Mapping[str, Any]
) -> dict[str, Choice]:
    """Return the densities by choice; the density of the fusion itself is that of ``random``."""

    def best(choices: Sequence[str], shared: Choice | None = None) -> dict[str, Choice]:
        methods = {choice: {"policy": POLICIES[choice], "fusion": fusion} for choice in choices}
        own = _choice_settings(choices[0], settings)
        return choose_densities(estimate_deg, methods, own, shared=shared)

    if fusion == "average":
        others = [choice for choice in CHOICES_WITH_TABLES if choice != "given_truth"]
        return best(others) | best(["given_truth"])
    shared_density = best(["random"])
    return shared_density | best([REGRESSION], shared=shared_density["random"])


def _estimate_frames(
    fusion: str,
    densities: Mapping[str, Choice],
    calibration_deg: NDArray[np.float64],
    test: Estimates,
    settings: Mapping[str, Any],
    rng_of: RngOf,
) -> dict[Pair, pd.DataFrame]:
    """Return the frames of all choices with one fusion of estimates."""
    shared = densities.get("random")
    fine = None if shared is None else chosen_evidence(calibration_deg, shared, settings)
    frames = {}
    for choice, policy in POLICIES.items():
        lookup = None
        if choice in CHOICES_WITH_TABLES:
            own = _choice_settings(choice, settings)
            density = shared or densities[choice]
            coarse = chosen_evidence(calibration_deg, density, own, COARSE_BINS)
            kernel = densities.get(choice, density)
            lookup = build_lookup(with_kernel(coarse, kernel), policy, fusion)
        method = {"policy": policy, "fusion": fusion}
        frames[choice, fusion] = evaluate_method(method, test, rng_of(choice), lookup, fine)
    return frames


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


def _densities_frame(densities: Mapping[Pair, Choice], pairs_of_row: float) -> pd.DataFrame:
    rows = []
    for pair, chosen in densities.items():
        alpha = chosen.pseudo_observations
        share = 100.0 * pairs_of_row / (pairs_of_row + alpha)
        rows.append((*pair, chosen.bandwidth_deg, alpha, share, chosen.error_deg))
    return pd.DataFrame(rows, columns=list(DENSITY_COLUMNS))

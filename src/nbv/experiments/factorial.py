"""Every choice of the next view with every fusion, on the same estimates of one fold.

A choice and a fusion are told apart only where both vary: the paper's method differs from Opposite
in the choice, and from its extensions in both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.experiments.extensions import choices_frame, stored_evidence
from nbv.experiments.kept_estimates import HeldOut
from nbv.experiments.more_views import more_views_rows
from nbv.experiments.two_views import evaluate_method
from nbv.recommendation.density_selection import Choice, chosen_evidence, most_likely_density
from nbv.recommendation.evidence import evidence_of_distributions
from nbv.recommendation.fusion import ESTIMATE_FUSIONS, OF_DISTRIBUTIONS
from nbv.recommendation.lookup import build_lookup
from nbv.recommendation.method_selection import select_methods

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
"""The policy of each choice; the pose ambiguity has two readings."""

OF_IMAGES = ("random", "fixed", "opposite", "information_gain", "expected_error")
"""Choices that are defined where images give distributions."""


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
        What calibration objects chose; as of `nbv.experiments.extensions.choices_frame`.
    """

    frames: dict[Pair, pd.DataFrame]
    more_views: pd.DataFrame
    densities: pd.DataFrame


def evaluate_factorial(
    calibration: HeldOut,
    test: HeldOut,
    settings: Mapping[str, Any],
    more_views: Mapping[str, Any],
    rng_of: Callable[[str], np.random.Generator],
) -> Factorial:
    """Evaluate every choice with every fusion on the test objects of one fold.

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
    known, tested = calibration.estimates, test.estimates
    frames = {
        SINGLE: evaluate_method({"policy": "none", "fusion": "average"}, tested),
        AS_PRINTED: _as_printed(known, tested, settings),
    }
    densities = []
    others = [choice for choice in POLICIES if choice != "given_truth"]
    for choices, reading in ((others, "given_estimate"), (["given_truth"], "given_truth")):
        own = dict(settings) | {"pose_likelihood": reading}
        made, chosen = _evaluated(_pairs(choices, ESTIMATE_FUSIONS), known, tested, own, rng_of)
        frames |= made
        densities.append(chosen)
    evidences = stored_evidence(known, densities[0], settings)
    of_images, evidence = calibration.posteriors, None
    if of_images is not None:
        pairs = _pairs(OF_IMAGES, sorted(OF_DISTRIBUTIONS))
        few = calibration.estimates_of_posteriors, test.estimates_of_posteriors
        made, chosen = _evaluated(pairs, *few, settings, rng_of, of_images, test.posteriors)
        frames |= made
        densities.append(chosen)
        evidence = evidence_of_distributions(of_images.distributions, settings)
    rng = rng_of("more_views")
    rows = more_views_rows(tested, evidences, more_views, rng, test.posteriors, evidence)
    return Factorial(frames, rows, pd.concat(densities, ignore_index=True))


def _pairs(choices: Iterable[str], fusions: Iterable[str]) -> list[Pair]:
    return [(choice, fusion) for choice in choices for fusion in fusions]


def _evaluated(
    pairs: Iterable[Pair],
    calibration: Estimates,
    test: Estimates,
    settings: Mapping[str, Any],
    rng_of: Callable[[str], np.random.Generator],
    calibration_posteriors: Posteriors | None = None,
    test_posteriors: Posteriors | None = None,
) -> tuple[dict[Pair, pd.DataFrame], pd.DataFrame]:
    """Return the frame of each pair, and the densities that were chosen."""
    named = {f"{choice}_{fusion}": (choice, fusion) for choice, fusion in pairs}
    methods = {name: {"policy": POLICIES[c], "fusion": f} for name, (c, f) in named.items()}
    selected = select_methods(calibration, methods, settings, calibration_posteriors)
    frames = {
        named[name]: evaluate_method(
            methods[name],
            test,
            rng_of(named[name][0]),
            one.lookup,
            one.evidence,
            test_posteriors,
        )
        for name, one in selected.items()
    }
    return frames, choices_frame(selected)


def _as_printed(
    calibration: Estimates, test: Estimates, settings: Mapping[str, Any]
) -> pd.DataFrame:
    reading = {"pose_likelihood": "given_truth", "pseudo_observations": [0.0]}
    own = dict(settings) | reading
    likeliest = most_likely_density(calibration.estimate_deg, own)
    evidence = chosen_evidence(calibration.estimate_deg, Choice(likeliest.bandwidth_deg, 0.0), own)
    lookup = build_lookup(evidence, "pose_ambiguity")
    return evaluate_method({"policy": "pose_ambiguity", "fusion": "average"}, test, lookup=lookup)

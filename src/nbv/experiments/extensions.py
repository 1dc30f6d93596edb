"""Extensions on the test objects of one fold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.experiments.travel import travel_rows
from nbv.experiments.two_views import evaluate_method
from nbv.recommendation.evidence import Evidence, gather_evidence
from nbv.recommendation.fusion import OF_DISTRIBUTIONS
from nbv.recommendation.lookup import LookupTable
from nbv.recommendation.method_selection import Methods, SelectedMethod, select_methods

CHOICE_COLUMNS = (
    "method",
    "policy",
    "fusion",
    "bandwidth_deg",
    "pseudo_observations",
    "validated_error_deg",
)


@dataclass(frozen=True)
class ExtensionEvaluations:
    """What extensions make of the test objects of one fold.

    Attributes
    ----------
    frames : dict of DataFrame
        By extension, as of `evaluate_method`.
    lookups : dict of LookupTable
        Of the extensions that follow one.
    choices : DataFrame
        Of `choices_frame`.
    travel : DataFrame
        Of `nbv.experiments.travel.travel_rows`.
    """

    frames: dict[str, pd.DataFrame]
    lookups: dict[str, LookupTable]
    choices: pd.DataFrame
    travel: pd.DataFrame


def evaluate_extensions(
    calibration: Estimates,
    test: Estimates,
    extensions: Methods,
    settings: Mapping[str, Any],
    rng_of: Callable[[str], np.random.Generator],
    calibration_posteriors: Posteriors | None = None,
    test_posteriors: Posteriors | None = None,
) -> ExtensionEvaluations:
    """Choose what each extension needs by calibration objects, and evaluate it on test objects.

    Parameters
    ----------
    calibration, test : Estimates
        Of one fold.
    extensions : mapping
        ``policy`` and ``fusion`` by name; see
        `nbv.recommendation.method_selection.select_methods`.
    settings : mapping
        The configuration's ``density`` and ``recommendation``.
    rng_of : callable
        The generator of an extension, by name.
    calibration_posteriors, test_posteriors : Posteriors, optional
        Of the same objects, where an extension fuses distributions.
    """
    selected = select_methods(calibration, extensions, settings, calibration_posteriors)
    frames = {}
    for name, one in selected.items():
        method = {"policy": one.policy, "fusion": one.fusion}
        of_images = test_posteriors if one.fusion in OF_DISTRIBUTIONS else None
        frames[name] = evaluate_method(
            method, test, rng_of(name), one.lookup, one.evidence, of_images
        )
    return ExtensionEvaluations(
        frames,
        {name: one.lookup for name, one in selected.items() if one.lookup is not None},
        choices_frame(selected),
        travel_rows(selected, test),
    )


def choices_frame(selected: Mapping[str, SelectedMethod]) -> pd.DataFrame:
    """Return what was chosen for each extension, columns `CHOICE_COLUMNS`.

    The density's columns are empty for methods that go by distributions of images.
    """
    rows = [
        (
            name,
            method.policy,
            method.fusion,
            method.choice.bandwidth_deg,
            method.choice.pseudo_observations,
            round(method.choice.error_deg, 4),
        )
        for name, method in selected.items()
    ]
    return pd.DataFrame(rows, columns=list(CHOICE_COLUMNS))


def stored_evidence(
    calibration: Estimates, choices: pd.DataFrame, settings: Mapping[str, Any]
) -> dict[str, Callable[[int], Evidence]]:
    """Return the evidence that each policy with posterior fusion was found to need.

    Parameters
    ----------
    calibration : Estimates
        The objects that the choices were made with.
    choices : DataFrame
        Columns `CHOICE_COLUMNS`.
    settings : mapping
        The configuration's ``density``.

    Returns
    -------
    dict of str to callable
        By policy; called with a number of bins. The same call returns the same object. Where no
        extension chooses by ``bayes_error`` it takes the density of ``expected_error``: both are
        errors after posterior fusion.
    """
    posterior = choices[choices["fusion"] == "posterior"].drop_duplicates("policy")

    def maker(bandwidth_deg: float, pseudo_observations: float) -> Callable[[int], Evidence]:
        return cache(
            lambda n_bins: gather_evidence(
                calibration.estimate_deg,
                settings,
                bandwidth_deg=bandwidth_deg,
                pseudo_observations=pseudo_observations,
                n_bins=n_bins,
            )
        )

    makers = {
        str(row["policy"]): maker(row["bandwidth_deg"], row["pseudo_observations"])
        for row in posterior.to_dict("records")
    }
    if "expected_error" in makers:
        makers.setdefault("bayes_error", makers["expected_error"])
    return makers

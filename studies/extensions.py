"""Evaluation of the extensions on the test objects of one fold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.evidence import Evidence
from nbv.core.circle.fusion import OF_DISTRIBUTIONS
from nbv.core.circle.lookup import CostTable
from nbv.core.circle.selection import DensityParams, chosen_evidence
from nbv.experiment.methods import Methods
from nbv.experiment.results import evaluate_method
from studies.curves import travel_rows
from studies.selection import SelectedMethod, select_methods

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
    """The results of the extensions on the test objects of one fold.

    Attributes
    ----------
    frames, lookups : dict
        By extension: frames of `evaluate_method`, and lookup tables of extensions that follow one.
    choices, travel : DataFrame
        From `choices_frame` and `studies.curves.travel_rows`.
    """

    frames: dict[str, pd.DataFrame]
    lookups: dict[str, CostTable]
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
    """Select each extension's density on calibration objects, and evaluate it on test objects.

    Parameters
    ----------
    calibration, test : Estimates
        The estimates of one fold.
    extensions, settings : mapping
        See `studies.selection.select_methods`.
    rng_of : callable
        Returns the generator of an extension, by name.
    calibration_posteriors, test_posteriors : Posteriors, optional
        The distributions of the same objects, where an extension fuses them.
    """
    selected = select_methods(calibration, extensions, settings, calibration_posteriors)
    frames = {
        name: evaluate_method(
            {"policy": method.policy, "fusion": method.fusion},
            test,
            rng_of(name),
            method.lookup,
            method.evidence,
            test_posteriors if method.fusion in OF_DISTRIBUTIONS else None,
        )
        for name, method in selected.items()
    }
    return ExtensionEvaluations(
        frames,
        {name: method.lookup for name, method in selected.items() if method.lookup is not None},
        choices_frame(selected),
        travel_rows(selected, test),
    )


def choices_frame(selected: Mapping[str, SelectedMethod]) -> pd.DataFrame:
    """Return the selected density of each extension, columns `CHOICE_COLUMNS`.

    The density's columns are empty for methods that use distributions of images.
    """
    rows = []
    for name, method in selected.items():
        density = method.density
        params = density.bandwidth_deg, density.pseudo_observations, round(density.error_deg, 4)
        rows.append((name, method.policy, method.fusion, *params))
    return pd.DataFrame(rows, columns=list(CHOICE_COLUMNS))


def stored_evidence(
    calibration: Estimates, choices: pd.DataFrame, settings: Mapping[str, Any]
) -> dict[str, Callable[[int], Evidence]]:
    """Return the evidence of the policies with posterior fusion, from the selected densities.

    Parameters
    ----------
    calibration : Estimates
        The objects of the selection.
    choices : DataFrame
        Columns `CHOICE_COLUMNS`.
    settings : mapping
        The configuration's ``density``.

    Returns
    -------
    dict of str to callable
        By policy; called with a number of bins. The same call returns the same object. Without an
        extension for ``bayes_error`` that policy uses the density of ``expected_error``: both are
        errors after posterior fusion.
    """
    posterior = choices[choices["fusion"] == "posterior"].drop_duplicates("policy")
    density = posterior.set_index("policy")[["bandwidth_deg", "pseudo_observations"]]
    makers: dict[str, Callable[[int], Evidence]] = {
        str(policy): cache(
            partial(chosen_evidence, calibration.estimate_deg, DensityParams(*chosen), settings)
        )
        for policy, *chosen in density.itertuples()
    }
    if "expected_error" in makers:
        makers.setdefault("bayes_error", makers["expected_error"])
    return makers

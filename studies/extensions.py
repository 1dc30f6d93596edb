"""Extensions on the test objects of one fold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence
from nbv.core.fusion import OF_DISTRIBUTIONS
from nbv.core.lookup import LookupTable
from nbv.core.selection import Choice, Methods, SelectedMethod, chosen_evidence, select_methods
from nbv.experiment.results import evaluate_method
from studies.curves import travel_rows

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
    frames, lookups : dict
        By extension: of `evaluate_method`, and the table of those that follow one.
    choices, travel : DataFrame
        Of `choices_frame` and of `studies.curves.travel_rows`.
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
    extensions, settings : mapping
        See `nbv.core.selection.select_methods`.
    rng_of : callable
        The generator of an extension, by name.
    calibration_posteriors, test_posteriors : Posteriors, optional
        Of the same objects, where an extension fuses distributions.
    """
    selected = select_methods(calibration, extensions, settings, calibration_posteriors)
    frames = {
        name: evaluate_method(
            {"policy": one.policy, "fusion": one.fusion},
            test,
            rng_of(name),
            one.lookup,
            one.evidence,
            test_posteriors if one.fusion in OF_DISTRIBUTIONS else None,
        )
        for name, one in selected.items()
    }
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
    rows = []
    for name, method in selected.items():
        choice = method.choice
        density = choice.bandwidth_deg, choice.pseudo_observations, round(choice.error_deg, 4)
        rows.append((name, method.policy, method.fusion, *density))
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
    density = posterior.set_index("policy")[["bandwidth_deg", "pseudo_observations"]]
    makers: dict[str, Callable[[int], Evidence]] = {
        str(policy): cache(
            partial(chosen_evidence, calibration.estimate_deg, Choice(*chosen), settings)
        )
        for policy, *chosen in density.itertuples()
    }
    if "expected_error" in makers:
        makers.setdefault("bayes_error", makers["expected_error"])
    return makers

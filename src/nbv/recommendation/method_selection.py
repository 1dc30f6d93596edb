"""Methods beyond the paper, on equal terms: each with the density that serves it best."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from nbv.calibration.estimates import Estimates
from nbv.errors import UserError
from nbv.files import read_csv
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.density_selection import Choice, choose_densities, chosen_evidence
from nbv.recommendation.evidence import Evidence, gather_evidence
from nbv.recommendation.fusion import FUSIONS
from nbv.recommendation.lookup import LookupTable, build_lookup
from nbv.recommendation.policies import ORACLE, SINGLE, check_names, needs_lookup

CHOSEN = "chosen"
"""As a rotation and a fusion: those of the pair that calibration objects favour."""

Contenders = Mapping[str, Mapping[str, Any]]

CHOICE_COLUMNS = (
    "method",
    "rotation",
    "fusion",
    "bandwidth_deg",
    "pseudo_observations",
    "validated_error_deg",
)


@dataclass(frozen=True)
class Entry:
    """One contender in one fold.

    Attributes
    ----------
    rotation, fusion : str
        What it does; never `CHOSEN`, but what was chosen.
    choice : Choice
        Its density's settings.
    evidence : Evidence
        Made with them of all calibration objects.
    lookup : LookupTable or None
        None for a rotation that follows no table.
    """

    rotation: str
    fusion: str
    choice: Choice
    evidence: Evidence
    lookup: LookupTable | None


def check_contenders(contenders: Contenders, methods: Contenders) -> None:
    """Check what a configuration says about contenders, and that their files have free names.

    Raises
    ------
    UserError
        Where a rotation or a fusion is unknown, or a name stands for something else already.
    """
    taken = {*methods, *(method["rotation"] for method in methods.values())}
    for name, method in contenders.items():
        if name in taken:
            raise UserError(f"contenders.{name}: the name is taken by a method; choose another")
        plain = {
            "rotation": "fixed" if method["rotation"] == CHOSEN else method["rotation"],
            "fusion": "average" if method["fusion"] == CHOSEN else method["fusion"],
        }
        check_names(f"contenders.{name}", plain)
        if plain["rotation"] == SINGLE:
            raise UserError(f"contenders.{name}.rotation={SINGLE}: it takes no second view")
        alike = [m for m in contenders.values() if m["fusion"] == plain["fusion"]]
        if plain["rotation"] == ORACLE and all(m["rotation"] == ORACLE for m in alike):
            raise UserError(f"contenders.{name}: no other contender fuses by {plain['fusion']}")
        if CHOSEN in method.values() and not _candidates(contenders):
            raise UserError(f"contenders.{name}: there is none to be chosen")


def _candidates(contenders: Contenders) -> list[str]:
    """Return the contenders that may be chosen: Opposite or a criterion, with a fusion rule."""
    return [
        name
        for name, method in contenders.items()
        if method["rotation"] in ("opposite", *CRITERIA) and method["fusion"] in FUSIONS
    ]


def enter(
    calibration: Estimates, contenders: Contenders, settings: Mapping[str, Any]
) -> dict[str, Entry]:
    """Choose each contender's density, and build its table, from calibration estimates alone.

    Parameters
    ----------
    calibration : Estimates
        Of objects that the estimator was not trained on.
    contenders : mapping
        ``rotation`` and ``fusion`` by name; either may be `CHOSEN`: that of the first contender
        listed, Opposite or a criterion, whose cross-validated error is not surely above the least.
    settings : mapping
        The configuration's ``density`` and ``travel``.
    """
    estimate_deg = calibration.estimate_deg
    own = {n: dict(m) for n, m in contenders.items() if CHOSEN not in m.values()}
    bounds = {n: m for n, m in own.items() if m["rotation"] == ORACLE}
    fair = {n: m for n, m in own.items() if n not in bounds}
    choices = choose_densities(estimate_deg, fair, settings)
    for name, method in bounds.items():
        choices[name] = _lent(method["fusion"], fair, choices)
    led = [name for name, method in contenders.items() if CHOSEN in method.values()]
    if led:
        winner = _winner(contenders, choices)
        followers = {name: _resolved(contenders[name], own[winner]) for name in led}
        new = {n: m for n, m in followers.items() if m not in own.values()}
        choices |= choose_densities(estimate_deg, new, settings) if new else {}
        for name, method in followers.items():
            same = next(other for other, plain in (own | new).items() if plain == method)
            choices[name] = choices[same]
        own |= followers
    made: dict[tuple[float, float], Evidence] = {}
    entries = {}
    for name in contenders:
        choice, method = choices[name], own[name]
        key = (choice.bandwidth_deg, choice.pseudo_observations)
        if key not in made:
            made[key] = chosen_evidence(estimate_deg, choice, settings)
        rotation, fusion = method["rotation"], method["fusion"]
        lookup = build_lookup(made[key], rotation, fusion) if needs_lookup(rotation) else None
        entries[name] = Entry(rotation, fusion, choice, made[key], lookup)
    return entries


def _lent(fusion: str, fair: Contenders, choices: Mapping[str, Choice]) -> Choice:
    """Return the density of the best contender that fuses alike: an oracle chooses none."""
    alike = [choices[name] for name, method in fair.items() if method["fusion"] == fusion]
    return min(alike, key=lambda choice: choice.error_deg)


def _winner(contenders: Contenders, choices: Mapping[str, Choice]) -> str:
    """Return the first candidate, as listed, that the best is not surely better than.

    The rule of one standard error (Breiman et al., 1984): what few calibration objects cannot
    tell apart is decided by the order of caution in which the configuration lists them.
    """
    names = _candidates(contenders)
    errors = [choices[name].error_deg for name in names]
    if np.isnan(errors).any():
        return names[0]
    best = choices[names[int(np.argmin(errors))]]
    return next(name for name in names if not surely_better(best, choices[name]))


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


def _resolved(method: Mapping[str, Any], winner: Mapping[str, Any]) -> dict[str, Any]:
    return {key: winner[key] if value == CHOSEN else value for key, value in method.items()}


def choices_frame(entries: Mapping[str, Entry]) -> pd.DataFrame:
    """Return what was chosen for each contender, columns `CHOICE_COLUMNS`."""
    rows = [
        (
            name,
            entry.rotation,
            entry.fusion,
            entry.choice.bandwidth_deg,
            entry.choice.pseudo_observations,
            round(entry.choice.error_deg, 4),
        )
        for name, entry in entries.items()
    ]
    return pd.DataFrame(rows, columns=list(CHOICE_COLUMNS))


def read_choices(path: str | Path) -> pd.DataFrame:
    """Read what `choices_frame` returned."""
    return read_csv(path)


def stored_evidence(
    calibration: Estimates, choices: pd.DataFrame, settings: Mapping[str, Any]
) -> dict[str, Callable[[int], Evidence]]:
    """Return the evidence that each rotation with posterior fusion was found to need.

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
        By rotation; called with a number of bins. The same call returns the same object.
    """
    posterior = choices[choices["fusion"] == "posterior"].drop_duplicates("rotation")

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

    return {
        str(row["rotation"]): maker(row["bandwidth_deg"], row["pseudo_observations"])
        for row in posterior.to_dict("records")
    }

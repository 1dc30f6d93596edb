"""Ablation of the method: one setting at a time is changed, and the table of the results."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from typing import Any

import pandas as pd

from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.estimates import Estimates
from nbv.core.circle.fusion import ESTIMATE_FUSIONS
from nbv.core.circle.policies import HeldOutViews, two_views
from nbv.core.circle.selection import (
    DensityParams,
    choose_densities,
    chosen_evidence,
    most_likely_density,
)
from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.paired import Resampler
from nbv.labels import number
from studies.object_errors import mae_difference, mae_interval, paired_objects

ALL = 0
"""The value of ``n_calibration`` for all calibration objects."""

PAPER: Mapping[str, Any] = {
    "criterion": "pose_ambiguity",
    "fusion": "average",
    "pose_likelihood": "given_estimate",
    "spread": "entropy",
    "chosen_by": "decision",
    "bandwidth_deg": 0.0,
    "pseudo_observations": 0.0,
    "n_bins": 360,
    "n_calibration": ALL,
}
"""The paper's method; bandwidth and pseudo-observations are chosen by calibration objects."""


def ablation_space() -> pd.DataFrame:
    """Return the settings of the ablation, one row each; the first is the paper's method.

    ``varied`` names the setting that a row changes. Where ``chosen_by`` is ``given`` the density
    has the row's ``bandwidth_deg`` and ``pseudo_observations``.
    """
    rows = [{"varied": "nothing", **PAPER}]
    rows += [{"varied": varied, **PAPER, **change} for varied, change in _changes()]
    return pd.DataFrame(rows)


def _changes() -> Iterator[tuple[str, dict[str, Any]]]:
    for bandwidth in (1.5, 3.0, 6.0, 12.0, 24.0):
        for alpha in (0.0, 10.0, 100.0):
            given = {"chosen_by": "given", "bandwidth_deg": bandwidth}
            yield "density", given | {"pseudo_observations": alpha}
    yield "chosen_by", {"chosen_by": "likelihood"}
    for pose_likelihood in ("given_estimate", "given_truth"):
        for spread in ("entropy", "circular_variance"):
            change = {"pose_likelihood": pose_likelihood, "spread": spread}
            if change != {key: PAPER[key] for key in change}:
                yield "pose_likelihood", change
    for n_bins in (36, 72, 120, 180):
        yield "bins", {"n_bins": n_bins}
    for n_calibration in (2, 5, 10, 15):
        yield "calibration_objects", {"n_calibration": n_calibration}
    for criterion in CRITERIA:
        # The Bayes expectation takes long to tabulate; it serves to choose more than two views.
        for fusion in ESTIMATE_FUSIONS if criterion != "bayes_error" else ():
            if (criterion, fusion) != (PAPER["criterion"], PAPER["fusion"]):
                yield "criterion_and_fusion", {"criterion": criterion, "fusion": fusion}


def ablate(
    calibration: Estimates,
    test: Estimates,
    instance: Mapping[str, Any],
    settings: Mapping[str, Any],
) -> pd.DataFrame:
    """Return each test object's mean error in one fold, columns ``object_id, error_deg``.

    Parameters
    ----------
    calibration, test : Estimates
        The estimates of one fold.
    instance : mapping
        A row of `ablation_space`.
    settings : mapping
        The configuration's ``density``.
    """
    wanted = instance["n_calibration"]
    estimate_deg = calibration.estimate_deg[: wanted if wanted != ALL else None]
    settings = dict(settings) | {key: instance[key] for key in ("pose_likelihood", "spread")}
    method = {"policy": instance["criterion"], "fusion": instance["fusion"]}
    if instance["chosen_by"] == "given":
        density = DensityParams(instance["bandwidth_deg"], instance["pseudo_observations"])
    elif instance["chosen_by"] == "likelihood":
        density = most_likely_density(estimate_deg, settings)
    else:
        density = choose_densities(estimate_deg, {"ablated": method}, settings)["ablated"]
    evidence = chosen_evidence(estimate_deg, density, settings, instance["n_bins"])
    error = two_views(**method, views=HeldOutViews(test.estimate_deg, evidence)).error_deg
    return pd.DataFrame({"object_id": test.object_ids, "error_deg": error.mean(axis=1)})


def ablation_table(
    space: pd.DataFrame, errors: Mapping[int, pd.DataFrame], category: str, resampler: Resampler
) -> Table:
    """Return the table of the ablation, every row compared with the first.

    ``space`` is that of `ablation_space`; ``errors`` maps the index of a row to the ``fold,
    object_id, error_deg`` of all folds.
    """
    named = [frame.assign(method=str(row)) for row, frame in errors.items()]
    sample = paired_objects(pd.concat(named), category)
    cells, printed = [], []
    for row, instance in enumerate(space.to_dict("records")):
        value = mae_interval(sample, str(row), resampler)
        less = mae_difference(sample, str(row), "0", resampler)
        cells.append(instance | value.columns("value", "ci") | less.columns("difference"))
        printed.append(
            (
                Cell(instance["varied"].replace("_", " ")),
                Cell(_described(instance)),
                Cell(number(value.value)),
                difference_cell(less.value, less.low, less.high) if row else Cell("–"),
            )
        )
    header = ("Varied", "Setting", "MAE", "Difference")
    notes = (
        "MAE in degrees. The first row is the paper's method with its density chosen by the "
        "cross-validated decision; each other row changes one thing.",
        f"Differences to the first row are paired by object, with 95 % intervals. {DECIDED}",
    )
    title = f"Ablation: {category}"
    return Table("ablation", title, title, pd.DataFrame(cells), header, tuple(printed), notes)


def _described(instance: Mapping[Hashable, Any]) -> str:
    if instance["varied"] == "density":
        return (
            f"bandwidth {instance['bandwidth_deg']:g}°, "
            f"{instance['pseudo_observations']:g} pseudo-observations"
        )
    named = {
        "chosen_by": instance["chosen_by"],
        "pose_likelihood": f"{instance['pose_likelihood']}, {instance['spread']}",
        "bins": str(instance["n_bins"]),
        "calibration_objects": str(instance["n_calibration"]),
        "criterion_and_fusion": f"{instance['criterion']}, {instance['fusion']}",
        "nothing": "the paper's method",
    }
    return str(named[instance["varied"]]).replace("_", " ")

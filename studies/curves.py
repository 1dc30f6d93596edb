"""Errors and travel against the number of views, and errors against travel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.circle.angles import nearest_bin, travel_deg
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.evidence import COARSE_BINS, Evidence
from nbv.core.circle.fusion import ESTIMATE_FUSIONS, Rotations, rotation_errors_deg
from nbv.core.circle.lookup import least_cost_delta
from nbv.core.circle.policies import HeldOutViews, take_second_views
from nbv.experiment.statistics.metrics import above_90, accuracy_area
from studies.selection import SelectedMethod
from studies.simulation import (
    FOR_MORE_VIEWS,
    DistributionViews,
    EstimatedViews,
    Views,
    bisecting_next,
    evenly_spaced_next,
    follow,
    random_next,
    recommended_next,
)

Floats = NDArray[np.float64]
Run = Callable[..., Floats]
Reached = tuple[str, Sequence[int], Floats]

VIEWS_COLUMNS = (
    "method",
    "n_views",
    "object_id",
    "error_deg",
    "pauc_percent",
    "above_90_percent",
    "travel_deg",
    "log_likelihood",
    "inside_50_percent",
    "inside_90_percent",
)


def more_views_rows(
    test: Estimates,
    evidences: Mapping[str, Callable[[int], Evidence]],
    settings: Mapping[str, Any],
    rng: np.random.Generator,
    posteriors: Posteriors | None = None,
    distribution_evidence: Evidence | None = None,
) -> pd.DataFrame:
    """Return the errors of every policy after each number of views, by object.

    Parameters
    ----------
    test : Estimates
        Test objects, 360 views each.
    evidences : mapping of str to callable
        The evidence for ``random``, ``opposite`` and every criterion, as a function of the number
        of bins. The pose ambiguity, which is defined for two views only, is absent.
    settings : mapping
        The configuration's ``more_views``: ``n_views, start_every_deg, min_separation_deg``.
    rng : numpy.random.Generator
    posteriors, distribution_evidence : optional
        The test objects' distributions, and evidence from those of calibration objects; they add
        policies with the fusion ``product``.

    Returns
    -------
    DataFrame
        Columns `VIEWS_COLUMNS`: means over first views. Travel goes from view to view, the shorter
        way. The last three describe the belief after all views; see
        `studies.simulation.follow`.
    """
    run = partial(follow, start_every_deg=settings["start_every_deg"], rng=rng)
    reached = list(_by_posterior(test, evidences, settings, run))
    if posteriors is not None and distribution_evidence is not None:
        reached += _by_product(posteriors, distribution_evidence, settings, run)
    rows = [
        _row(test.object_ids, method, n, outcomes[:, :, :, n - 1])
        for method, numbers, outcomes in reached
        for n in numbers
    ]
    return pd.concat(rows, ignore_index=True)


def _row(object_ids: tuple[str, ...], method: str, n_views: int, reached: Floats) -> pd.DataFrame:
    """Return the rows of one policy and number of views; `reached` comes from `follow`."""
    errors, *others = reached
    figures = (errors, accuracy_area(errors), above_90(errors), *others)
    means = (figure.mean(axis=1) for figure in figures)
    values = (method, n_views, object_ids, *means)
    return pd.DataFrame(dict(zip(VIEWS_COLUMNS, values, strict=True)))


def _by_posterior(
    test: Estimates,
    evidences: Mapping[str, Callable[[int], Evidence]],
    settings: Mapping[str, Any],
    run: Run,
) -> Iterator[Reached]:
    """Yield policy, numbers of views and the results of `follow`, fused by posterior."""
    every = range(1, settings["n_views"] + 1)

    def of(name: str) -> Views:
        return EstimatedViews(test.estimate_deg, evidences[name](test.estimate_deg.shape[1]))

    yield "random", every, run(random_next, of("random"), n_views=every[-1])
    yield "bisecting", every, run(bisecting_next, of("opposite"), n_views=every[-1])
    for n in every:
        yield "evenly_spaced", [n], run(evenly_spaced_next(n), of("opposite"), n_views=n)
    for criterion in FOR_MORE_VIEWS:
        if criterion in evidences:
            coarse = evidences[criterion](COARSE_BINS)
            policy = recommended_next(criterion, coarse, settings["min_separation_deg"])
            yield criterion, every, run(policy, of(criterion), n_views=every[-1])


def _by_product(
    posteriors: Posteriors, evidence: Evidence, settings: Mapping[str, Any], run: Run
) -> Iterator[Reached]:
    """Yield the same, fused by product."""
    every, apart_deg = range(1, settings["n_views"] + 1), settings["min_separation_deg"]
    seen = DistributionViews(posteriors.distributions, evidence)
    yield "random_product", every, run(random_next, seen, n_views=every[-1])
    for n in every:
        yield "evenly_spaced_product", [n], run(evenly_spaced_next(n), seen, n_views=n)
    by_gain = recommended_next("information_gain", evidence, apart_deg)
    yield "information_gain_product", every, run(by_gain, seen, n_views=every[-1])


# Multiples of the travel cost at which staying costs as much as moving for the mean estimate.
RELATIVE_COSTS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
LIMITS_DEG = (15, 30, 45, 60, 90, 120, 150, 180)
ANY_DIRECTION = "either_way"

TRAVEL_COLUMNS = ("method", "rule", "setting", "travel_deg", "error_deg", "n_images")


def travel_rows(selected: Mapping[str, SelectedMethod], test: Estimates) -> pd.DataFrame:
    """Return error against travel for every extension that follows a table, in one fold.

    Columns are `TRAVEL_COLUMNS`, means over test images. Rule ``cost``: `setting` is the cost in
    the criterion's unit per degree, at each of `RELATIVE_COSTS` times the table's mean range over
    180 degrees. Rule ``limit``: `setting` is the longest travel allowed, degrees. Under the name
    `ANY_DIRECTION` with its fusion, rule ``fixed``: travel by `setting` degrees one way or the
    other, whatever the estimate.
    """
    rows = []
    by_fusion: dict[str, SelectedMethod] = {}
    for name, method in selected.items():
        if method.fusion in ESTIMATE_FUSIONS:
            by_fusion.setdefault(method.fusion, method)
        if method.lookup is None:
            continue
        views = HeldOutViews(test.estimate_deg, method.evidence)
        for rule, setting, by_bin in _restricted(method.lookup.cost):
            delta = by_bin[nearest_bin(test.estimate_deg, len(by_bin))]
            error = take_second_views(delta, method.fusion, views).error_deg
            rows.append((name, rule, setting, travel_deg(delta).mean(), error.mean(), error.size))
    for fusion, method in by_fusion.items():
        errors = rotation_errors_deg(test.estimate_deg, method.evidence, fusion)
        by_delta = errors.reshape(len(errors), -1).mean(axis=1)
        for limit in (0, *LIMITS_DEG):
            either = (by_delta[limit] + by_delta[-limit % len(by_delta)]) / 2
            name = f"{ANY_DIRECTION}_{fusion}"
            rows.append((name, "fixed", limit, limit, either, errors[0].size))
    return pd.DataFrame(rows, columns=list(TRAVEL_COLUMNS))


def _restricted(cost: NDArray[np.float32]) -> Iterator[tuple[str, float, Rotations]]:
    """Yield the rule, its setting and the resulting rotation by estimate."""
    per_degree = float(np.ptp(cost, axis=1).mean()) / 180.0
    for relative in RELATIVE_COSTS:
        travel_cost = relative * per_degree
        yield "cost", travel_cost, least_cost_delta(cost, travel_cost=travel_cost)
    for limit in LIMITS_DEG:
        yield "limit", limit, least_cost_delta(cost, max_travel_deg=limit)


def pooled_travel(frames: Mapping[int, pd.DataFrame]) -> pd.DataFrame:
    """Return the curves of several folds as one, weighted by their images.

    The k-th costs of all folds are averaged, because costs are relative to the table of a fold.
    """
    parts = []
    for fold, frame in frames.items():
        i = frame.groupby(["method", "rule"], sort=False).cumcount()
        parts.append(frame.assign(fold=fold, i=i))
    everything = pd.concat(parts, ignore_index=True)
    weighted = ["setting", "travel_deg", "error_deg"]
    for column in weighted:
        everything[column] *= everything["n_images"]
    sums = everything.groupby(["method", "rule", "i"], sort=False)[[*weighted, "n_images"]].sum()
    for column in weighted:
        sums[column] /= sums["n_images"]
    return sums.reset_index().drop(columns="i")[list(TRAVEL_COLUMNS)]

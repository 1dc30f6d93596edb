"""More views than two: error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.criteria import FOR_MORE_VIEWS
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import COARSE_BINS, Evidence
from nbv.core.plans import (
    at_spacing,
    choose_plan,
    plans_of,
    step_by_step,
)
from nbv.core.simulation import (
    DistributionViews,
    EstimatedViews,
    Views,
    bisecting_next,
    evenly_spaced_next,
    first_views,
    follow,
    random_next,
    recommended_next,
)
from nbv.experiment.statistics.metrics import accuracy_area, half_turned

Floats = NDArray[np.float64]
Run = Callable[..., Floats]
Reached = tuple[str, Sequence[int], Floats]

COLUMNS = (
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
    of_distributions: Evidence | None = None,
) -> pd.DataFrame:
    """Return what every policy has reached after each number of views, object by object.

    Parameters
    ----------
    test : Estimates
        Test objects, 360 views each.
    evidences : mapping of str to callable
        For ``random``, ``opposite`` and each criterion: its evidence for a number of bins. The
        pose ambiguity, which is defined for two views alone, is left out.
    settings : mapping
        The configuration's ``more_views``: ``n_views, start_every_deg, min_separation_deg``.
    rng : numpy.random.Generator
    posteriors, of_distributions : optional
        The test objects' distributions, and evidence of those of calibration objects: policies with
        the fusion ``product`` are added.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views. Travel goes from view to view, the shorter way.
        The last three are of the belief after all views; see `nbv.core.simulation.follow`.
    """
    run = partial(follow, start_every_deg=settings["start_every_deg"], rng=rng)
    reached = list(_by_posterior(test, evidences, settings, run))
    if posteriors is not None and of_distributions is not None:
        reached += _by_product(posteriors, of_distributions, settings, run)
    rows = [
        _row(test.object_ids, method, n, of_views[:, :, :, n - 1])
        for method, numbers, of_views in reached
        for n in numbers
    ]
    return pd.concat(rows, ignore_index=True)


def _row(object_ids: tuple[str, ...], method: str, n_views: int, reached: Floats) -> pd.DataFrame:
    """Return the rows of one policy and number of views; `reached` is of `follow`."""
    errors, *others = reached
    figures = (errors, accuracy_area(errors), half_turned(errors), *others)
    means = (figure.mean(axis=1) for figure in figures)
    values = (method, n_views, object_ids, *means)
    return pd.DataFrame(dict(zip(COLUMNS, values, strict=True)))


def _by_posterior(
    test: Estimates,
    evidences: Mapping[str, Callable[[int], Evidence]],
    settings: Mapping[str, Any],
    run: Run,
) -> Iterator[Reached]:
    """Yield policy, numbers of views and what was reached, fused by posterior."""
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
    """Yield the same fused by product; from two views on the first one chooses a plan."""
    every, apart_deg = range(1, settings["n_views"] + 1), settings["min_separation_deg"]
    seen = DistributionViews(posteriors.distributions, evidence)
    yield "random_product", every, run(random_next, seen, n_views=every[-1])
    for n in every:
        yield "evenly_spaced_product", [n], run(evenly_spaced_next(n), seen, n_views=n)
    by_gain = recommended_next("information_gain", evidence, apart_deg)
    yield "information_gain_product", every, run(by_gain, seen, n_views=every[-1])
    belief = first_views(seen, settings["start_every_deg"])[2]
    yield "expected_error_product", [1], run(random_next, seen, n_views=1)
    for n in every[1:]:
        plans = plans_of(evidence, n, apart_deg)
        chosen = choose_plan(belief, evidence, plans)
        steps_deg = np.append(plans.spacing_deg, 0)[chosen]
        spaced = run(at_spacing(steps_deg), seen, n_views=n)
        stepped = run(step_by_step(evidence, apart_deg, n), seen, n_views=n)
        goes_on = (chosen == len(plans.spacing_deg)).reshape(spaced.shape[1:3])
        planned = np.where(goes_on[None, :, :, None], stepped, spaced)
        yield "expected_error_product", [n], planned

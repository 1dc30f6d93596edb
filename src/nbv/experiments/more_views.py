"""More views than two: error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.pose_errors import accuracy_area, half_turned
from nbv.recommendation.criteria import FOR_MORE_VIEWS
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.following import (
    DistributionViews,
    EstimatedViews,
    Views,
    first_views,
    follow,
)
from nbv.recommendation.next_views import (
    COARSE_BINS,
    NextView,
    bisecting_next,
    evenly_spaced_next,
    random_next,
    recommended_next,
)
from nbv.recommendation.plans import (
    at_spacing,
    choose_plan,
    plans_of,
    step_by_step_errors_deg,
)

Floats = NDArray[np.float64]

COLUMNS = (
    "method",
    "n_views",
    "object_id",
    "error_deg",
    "pauc_percent",
    "above_90_percent",
    "travel_deg",
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
    """
    rows: list[pd.DataFrame] = []
    every = range(1, settings["n_views"] + 1)
    apart_deg, start_every_deg = settings["min_separation_deg"], settings["start_every_deg"]

    def reached(policy: NextView, views: Views, n_views: int) -> Floats:
        return follow(policy, views, n_views=n_views, start_every_deg=start_every_deg, rng=rng)

    def add(method: str, of_views: Floats, numbers: Sequence[int]) -> None:
        errors, travel = of_views
        figures = (errors, accuracy_area(errors), half_turned(errors), travel)
        for n in numbers:
            means = [figure[:, :, n - 1].mean(axis=1) for figure in figures]
            values = (method, n, test.object_ids, *means)
            rows.append(pd.DataFrame(dict(zip(COLUMNS, values, strict=True))))

    def of(name: str) -> Views:
        return EstimatedViews(test.estimate_deg, evidences[name](test.estimate_deg.shape[1]))

    add("random", reached(random_next, of("random"), every[-1]), every)
    add("bisecting", reached(bisecting_next, of("opposite"), every[-1]), every)
    for n in every:
        add("evenly_spaced", reached(evenly_spaced_next(n), of("opposite"), n), [n])
    for criterion in FOR_MORE_VIEWS:
        if criterion in evidences:
            policy = recommended_next(criterion, evidences[criterion](COARSE_BINS), apart_deg)
            add(criterion, reached(policy, of(criterion), every[-1]), every)
    if posteriors is None or of_distributions is None:
        return pd.concat(rows, ignore_index=True)
    seen = DistributionViews(posteriors.distributions, of_distributions)
    belief = first_views(seen, start_every_deg)[2]
    add("random_product", reached(random_next, seen, every[-1]), every)
    by_gain = recommended_next("information_gain", of_distributions, apart_deg)
    step_by_step = reached(by_gain, seen, every[-1])
    add("information_gain_product", step_by_step, every)
    of_calibration = step_by_step_errors_deg(of_distributions, every[-1], apart_deg)
    for n in every:
        add("evenly_spaced_product", reached(evenly_spaced_next(n), seen, n), [n])
        if n == 1:
            continue
        plans = plans_of(of_distributions, n, of_calibration, apart_deg)
        chosen = choose_plan(belief, of_distributions, plans)
        steps_deg = np.append(plans.spacing_deg, 0)[chosen]
        spaced = reached(at_spacing(steps_deg), seen, n)
        goes_on = (chosen == len(plans.spacing_deg)).reshape(spaced.shape[1:3])
        planned = np.where(goes_on[None, :, :, None], step_by_step[..., :n], spaced)
        add("expected_error_product", planned, [n])
    return pd.concat(rows, ignore_index=True)

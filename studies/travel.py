"""Error against travel: each lookup table with a travel cost, or with a limit on travel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin, travel_deg
from nbv.core.estimates import Estimates
from nbv.core.fusion import ESTIMATE_FUSIONS, Rotations, rotation_errors_deg
from nbv.core.lookup import least_cost_delta
from nbv.core.policies import TestViews, take_second_views
from nbv.core.selection import SelectedMethod

# Multiples of the travel cost at which, for the average estimate, staying costs as little as going.
RELATIVE_COSTS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
LIMITS_DEG = (15, 30, 45, 60, 90, 120, 150, 180)
ANY_DIRECTION = "either_way"

COLUMNS = ("method", "rule", "setting", "travel_deg", "error_deg", "n_images")


def travel_rows(selected: Mapping[str, SelectedMethod], test: Estimates) -> pd.DataFrame:
    """Return error against travel for every extension of a fold that follows a table.

    Columns are `COLUMNS`, means over test images. Rule ``cost``: `setting` is the cost in the
    criterion's unit per degree, at each of `RELATIVE_COSTS` times the table's mean range over 180
    degrees. Rule ``limit``: `setting` is the longest travel allowed, degrees. Under the name
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
        views = TestViews(test.estimate_deg, method.evidence)
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
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _restricted(cost: NDArray[np.float32]) -> Iterator[tuple[str, float, Rotations]]:
    """Yield a rule, its setting and the rotation for each estimate under it."""
    per_degree = float(np.ptp(cost, axis=1).mean()) / 180.0
    for relative in RELATIVE_COSTS:
        travel_cost = relative * per_degree
        yield "cost", travel_cost, least_cost_delta(cost, travel_cost=travel_cost)
    for limit in LIMITS_DEG:
        yield "limit", limit, least_cost_delta(cost, max_travel_deg=limit)


def pooled_travel(frames: Mapping[int, pd.DataFrame]) -> pd.DataFrame:
    """Return the curves of several folds as one, weighted by their images.

    The k-th cost of one fold is averaged with the k-th of the others: costs are relative to
    each fold's own table.
    """
    parts = []
    for fold, frame in frames.items():
        place = frame.groupby(["method", "rule"], sort=False).cumcount()
        parts.append(frame.assign(fold=fold, place=place))
    everything = pd.concat(parts, ignore_index=True)
    weighted = ["setting", "travel_deg", "error_deg"]
    for column in weighted:
        everything[column] *= everything["n_images"]
    sums = everything.groupby(["method", "rule", "place"], sort=False)[
        [*weighted, "n_images"]
    ].sum()
    for column in weighted:
        sums[column] /= sums["n_images"]
    return sums.reset_index().drop(columns="place")[list(COLUMNS)]

"""Errors and travel: against the number of views, and against each other; rows, tables, curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin, travel_deg
from nbv.core.criteria import FOR_MORE_VIEWS
from nbv.core.estimates import Estimates, Posteriors
from nbv.core.evidence import Evidence
from nbv.core.fusion import ESTIMATE_FUSIONS, Rotations, rotation_errors_deg
from nbv.core.lookup import least_cost_delta
from nbv.core.next_views import (
    COARSE_BINS,
    bisecting_next,
    evenly_spaced_next,
    random_next,
    recommended_next,
)
from nbv.core.plans import (
    at_spacing,
    choose_plan,
    plans_of,
    step_by_step,
)
from nbv.core.policies import Turns, take_second_views
from nbv.core.selection import SelectedMethod
from nbv.core.simulation import (
    DistributionViews,
    EstimatedViews,
    Views,
    first_views,
    follow,
)
from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.metrics import accuracy_area, half_turned
from nbv.experiment.statistics.paired import Resampler, mae_difference, mae_interval, paired_objects
from nbv.files import existing, read_csv
from nbv.labels import category_label, method_label, number
from nbv.robot.style import RC, Panels, method_style, panel_grid

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
    posteriors, of_distributions : optional
        The test objects' distributions, and evidence from those of calibration objects; they add
        policies with the fusion ``product``.

    Returns
    -------
    DataFrame
        Columns `VIEWS_COLUMNS`: means over first views. Travel goes from view to view, the shorter
        way. The last three describe the belief after all views; see
        `nbv.core.simulation.follow`.
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
    figures = (errors, accuracy_area(errors), half_turned(errors), *others)
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
    """Yield the same, fused by product; with two views and more the first one chooses a plan."""
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
        turns = Turns(test.estimate_deg, method.evidence)
        for rule, setting, by_bin in _restricted(method.lookup.cost):
            delta = by_bin[nearest_bin(test.estimate_deg, len(by_bin))]
            error = take_second_views(delta, method.fusion, turns).error_deg
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


_PRODUCT = "_product"
_PANEL_IN = (3.4, 2.9)


def read_rows(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Read rows by category and fold; return them by category with a column ``fold``."""
    parts: dict[str, list[pd.DataFrame]] = {}
    for (category, fold), path in files.items():
        parts.setdefault(category, []).append(read_csv(existing(path)).assign(fold=fold))
    return {category: pd.concat(frames) for category, frames in parts.items()}


def more_views_table(rows_by_category: Mapping[str, pd.DataFrame], resampler: Resampler) -> Table:
    """Return error and travel against the number of views, by category and policy.

    The rows have `VIEWS_COLUMNS` and ``fold``. The last column compares a
    policy's three views with four at random.
    """
    cells, printed = [], []
    views = sorted({n for rows in rows_by_category.values() for n in rows["n_views"]})
    for category, rows in rows_by_category.items():
        named = rows.assign(method=rows["method"] + "@" + rows["n_views"].astype(str))
        sample = paired_objects(named, category)
        travel = named.groupby("method")["travel_deg"].mean()
        for method in dict.fromkeys(rows["method"]):
            row, last = [Cell(f"{category_label(category)}: {method_label(method)}")], Cell("–")
            for n_views in views:
                name = f"{method}@{n_views}"
                if name not in sample.errors_deg:
                    row.append(Cell("–"))
                    continue
                mae = mae_interval(sample, name, resampler)
                made = {"category": category, "method": method, "n_views": n_views}
                made |= mae.columns("value", "ci") | {"travel_deg": travel[name]}
                if n_views == 3 and method != "random" and "random@4" in sample.errors_deg:
                    less = mae_difference(sample, name, "random@4", resampler)
                    made |= less.columns("to_random_4")
                    last = difference_cell(less.value, less.low, less.high)
                cells.append(made)
                row.append(Cell(number(mae.value), after=f"[{travel[name]:.0f}°]"))
            printed.append((*row, last))
    header = ("Policy", *(f"{n} view{'s' if n > 1 else ''}" for n in views), "3 views − Random's 4")
    notes = (
        f"MAE in degrees [mean travel from view to view]; {_fusions(rows_by_category)}.",
        f"Last column: paired by object, 95 % interval. {DECIDED}",
        "Evenly spaced knows the number of views before the first view; its last one is shown.",
    )
    title = "Error and travel against the number of views"
    return Table("more_views", title, title, pd.DataFrame(cells), header, tuple(printed), notes)


def _fusions(rows_by_category: Mapping[str, pd.DataFrame]) -> str:
    methods = {method for rows in rows_by_category.values() for method in rows["method"]}
    if any(method.endswith("_product") for method in methods):
        return "fused by posterior, or by product where the policy's name says so"
    return "all fused by posterior"


@mpl.rc_context(RC)
def more_views_figure(cells: pd.DataFrame) -> Figure:
    """Draw the cells of `more_views_table`, a panel for each category and fusion."""
    by_product = cells["method"].str.endswith(_PRODUCT)
    drawn = cells.assign(by_product=by_product, policy=cells["method"].str.removesuffix(_PRODUCT))
    policies = tuple(dict.fromkeys(drawn["policy"]))
    parts = list(drawn.groupby(["by_product", "category"], sort=False))
    grid = panel_grid(len(parts), *_PANEL_IN)
    for axes, ((product, category), part) in zip(grid.panels, parts, strict=True):
        for policy, curve in part.groupby("policy", sort=False):
            _draw(axes, curve["n_views"], curve["value"], str(policy), policies)
        fusion = "product" if product else "posterior"
        shown = f" (fused by {fusion})" if by_product.any() else ""
        axes.set_title(category_label(str(category)) + shown)
        axes.set_xticks(sorted(part["n_views"].unique()))
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Number of views")
        axes.set_ylabel("MAE (degrees)")
    _add_key(grid)
    return grid.figure


def travel_curves(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Return error against travel by category, all folds pooled.

    The files, by category and fold, hold rows of `travel_rows`.
    """
    return {
        category: pooled_travel({int(str(fold)): part for fold, part in rows.groupby("fold")})
        for category, rows in read_rows(files).items()
    }


@mpl.rc_context(RC)
def travel_figure(curves: Mapping[str, pd.DataFrame], methods: tuple[str, ...]) -> Figure:
    """Draw error against mean travel as its cost rises, a panel for each of `travel_curves`."""
    grid = panel_grid(len(curves), *_PANEL_IN)
    for axes, (category, rows) in zip(grid.panels, curves.items(), strict=True):
        for method in methods:
            rule = "fixed" if method.startswith(ANY_DIRECTION) else "cost"
            curve = rows[(rows["method"] == method) & (rows["rule"] == rule)]
            curve = curve.sort_values("travel_deg")
            _draw(axes, curve["travel_deg"], curve["error_deg"], method, methods)
        axes.set_title(category_label(category))
        axes.set_xlim(0, 180)
        axes.set_xticks([0, 45, 90, 135, 180])
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Mean travel (degrees)")
        axes.set_ylabel("MAE (degrees)")
    _add_key(grid)
    return grid.figure


def travel_table(curves: Mapping[str, pd.DataFrame]) -> Table:
    """Return `travel_curves` as a table for a CSV file."""
    cells = pd.concat([curve.assign(category=category) for category, curve in curves.items()])
    title = "Error against travel"
    return Table("travel", title, title, cells, header=(), rows=(), decimals=6)


def _draw(axes: Axes, x: pd.Series, y: pd.Series, method: str, methods: tuple[str, ...]) -> None:
    style = method_style(method, methods)
    axes.plot(x, y, label=method_label(method), marker=style.marker, markersize=4, **style.curve)


def _add_key(grid: Panels) -> None:
    named = {
        label: handle
        for axes in grid.panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    grid.add_key(list(named.values()))

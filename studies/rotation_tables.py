"""The table of the study `rotations`: pooled over objects, and object by object."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.orientations.group import ASYMMETRIC, VOLUME, Symmetry
from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.statistics.metrics import Floats, Interval, percentile_interval
from nbv.labels import category_label, counted, interval_text, number
from nbv.tables.next_camera import CameraRecommendation
from studies.solids import SOLIDS, solid
from studies.trainings import crossed_mean

FIGURES = ("error_deg", "above_30", "n_views")
"""Columns of every instance and method; an object's are the means over its instances."""

LESS = {
    "less_random": "less random",
    "less_chance": "less chance, the instance's mean number",
    "less_chance_overall": "less chance, the overall mean number",
}


def _resample(index: pd.Index[Any], rng: np.random.Generator, n_resamples: int) -> Floats:
    """Return the weights (n_resamples, n) of instances (n,) in resamples.

    Each draws units, then instances of each drawn unit, both with replacement. Units are the
    objects; of categories that have several trainings, the trainings of each.
    """
    names = index.to_frame(index=False)
    object_id = pd.factorize(names["object_id"])[0]
    is_trained = "training" in names
    unit = pd.factorize(names["training"])[0] if is_trained else object_id
    parts = object_id if is_trained else np.zeros(len(index), dtype=np.intp)
    members = [
        [np.flatnonzero((parts == part) & (unit == k)) for k in np.unique(unit[parts == part])]
        for part in np.unique(parts)
    ]
    weights = np.zeros((n_resamples, len(index)))
    for row in weights:
        for units in members:
            for k in rng.integers(len(units), size=len(units)):
                drawn = rng.choice(units[k], size=len(units[k]))
                np.add.at(row, drawn, 1 / (len(drawn) * len(units) * len(members)))
    return weights


def _mean(values: pd.Series, weights: Floats) -> Interval:
    """Return the mean over objects of values of instances (n,), with the resamples' interval."""
    means = values.groupby(level="object_id").mean()
    samples = weights @ values.to_numpy(dtype=np.float64)
    return Interval(float(means.mean()), *percentile_interval(samples))


def by_symmetry(objects: Sequence[str], models_info: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return objects in two groups: those with an axis of continuous symmetry, and others."""
    axis = {name: Symmetry.from_bop(models_info.get(name, {})).axis for name in objects}
    return {
        "no symmetry or a discrete one": [name for name in objects if axis[name] is None],
        "turning freely": [name for name in objects if axis[name] is not None],
    }


STOPS: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "decision": lambda rows: rows["verdict"] != "one more view",
    "belief": lambda rows: rows["probability"] >= CameraRecommendation.STOP_PROBABILITY,
    "score": lambda rows: rows["flip_ratio"] <= SCORE_ENOUGH,
}
"""Rules to stop after a view: the product's decision, its probability, and the score alone."""

SCORE_ENOUGH = 0.5
"""Likelihood ratio of a flip, given the score of the last view, that is enough."""


def stopped(walks: pd.DataFrame, is_enough: pd.Series) -> pd.DataFrame:
    """Return the row of each walk at which it stops: the first that is enough, else the last."""
    walk = ["instance", "first", "order"]
    if "training" in walks:
        walk.append("training")
    # Rows are in the order of views.
    last = walks.groupby(walk, sort=False).tail(1)
    return pd.concat([walks[is_enough], last]).groupby(walk, sort=False).head(1)


def method_errors(walks: pd.DataFrame) -> pd.DataFrame:
    """Return figures of each instance (index) and method; columns are (figure, method).

    Methods are ``<order>_<number of views>`` and ``<order>_<rule of STOPS>``. Figures are the mean
    error, the share above 30 degrees, and the mean number of views; and for each rule the error of
    the same order of views where the number of views is drawn by chance, with the rule's mean
    number of the instance (``chance``) or of all instances (``chance_overall``).
    """
    index = ["object_id", *(["training"] if "training" in walks else []), "instance"]
    walks = walks.assign(above_30=walks["error_deg"] > 30)
    figures: dict[tuple[str, str], pd.Series] = {}
    for order, rows in walks.groupby("order", sort=False):
        fixed = {}
        for n_views in range(1, int(rows["n_views"].max()) + 1):
            at_n = stopped(rows, rows["n_views"] == n_views).groupby(index)
            fixed[n_views] = at_n["error_deg"].mean()
            _add(figures, f"{order}_{n_views}", at_n)
        curve = pd.DataFrame(fixed)
        for rule, is_enough in STOPS.items():
            method = f"{order}_{rule}"
            _add(figures, method, stopped(rows, is_enough(rows)).groupby(index))
            mean_views = figures["n_views", method]
            overall = mean_views.groupby(level="object_id").mean().mean()
            for name, at in (("chance", mean_views), ("chance_overall", overall)):
                values = zip(np.broadcast_to(at, len(curve)), curve.to_numpy(), strict=True)
                errors = [np.interp(number, curve.columns, each) for number, each in values]
                figures[name, method] = pd.Series(errors, curve.index)
    return pd.DataFrame(figures)


def _add(figures: dict[tuple[str, str], pd.Series], method: str, groups: Any) -> None:
    for name in ("error_deg", "above_30", "n_views"):
        figures[name, method] = groups[name].mean()


def orientation_table(
    walks: pd.DataFrame,
    groups: Mapping[str, Sequence[str]],
    n_resamples: int,
    rng: np.random.Generator,
) -> Table:
    """Return the table of all methods, for each group of objects.

    Parameters
    ----------
    walks : DataFrame
        As of `studies.rotations.evaluate`; with a column ``training`` where each object is a
        category and its instances are judged by several trainings.
    groups : mapping
        Objects by the name of their group.
    n_resamples : int
        For the intervals.
    """
    parts, cells = [], []
    is_trained = "training" in walks
    figures = method_errors(walks)
    for group, objects in groups.items():
        of_group = figures[figures.index.get_level_values("object_id").isin(objects)]
        if of_group.empty:
            continue
        weights = _resample(of_group.index, rng, n_resamples)
        errors = of_group["error_deg"]
        rows: list[Row] = []
        for method in errors:
            mean = {name: _mean(of_group[name][method], weights) for name in FIGURES}
            error = mean["error_deg"]
            order, n_views = str(method).split("_")
            others = {"less_random": errors[f"random_{n_views}"]} if order != "random" else {}
            if n_views in STOPS:
                for name in ("chance", "chance_overall"):
                    others[f"less_{name}"] = of_group[name][method]
            less = {name: _mean(errors[method] - other, weights) for name, other in others.items()}
            cells.append(
                {"group": group, "method": method}
                | {name: figure.value for name, figure in mean.items()}
                | error.columns("error_deg", "ci")
                | {k: v for name, each in less.items() for k, v in each.columns(name).items()}
            )
            differences = (less.get(name) for name in LESS)
            rows.append(
                (
                    Cell(f"{order}, {n_views if n_views.isdigit() else f'until the {n_views}'}"),
                    Cell(number(mean["n_views"].value)),
                    Cell(interval_text(error.value, error.low, error.high, 1)),
                    Cell(number(100 * mean["above_30"].value, 1)),
                    *(
                        Cell("") if d is None else difference_cell(d.value, d.low, d.high)
                        for d in differences
                    ),
                )
            )
        n_instances = of_group.index.get_level_values("instance").nunique()
        n_objects = counted(len(set(of_group.index.get_level_values("object_id"))), "object")
        of = group if is_trained else f"{n_objects}, {group}"
        parts.append(Part(tuple(rows), f"{of}, {n_instances} instances"))
    drawn = "each category's trainings" if is_trained else "objects"
    title = "Up to four views in three dimensions"
    return Table(
        "rotations",
        title,
        title,
        pd.DataFrame(cells),
        ("Order of views, number", "views", "Error (°)", "> 30° (%)", *LESS.values()),
        tuple(parts),
        (
            "Errors are modulo symmetry. Figures are means over objects of means over instances.",
            f"In brackets 95 % intervals: {n_resamples} resamples of {drawn}, then instances.",
            "Less chance: less the same order with a number of views that is drawn by chance.",
            DECIDED,
        ),
    )


def estimator_table(pairs: pd.DataFrame, n_poses: int) -> Table:
    """Return the table of the study's own estimators, of one view.

    Parameters
    ----------
    pairs : DataFrame
        Columns ``object_id, instance, role, log_likelihood, error_deg``.
    n_poses : int
        In the estimators' grid.
    """
    cells, rows = [], []
    for name, part in pairs[pairs["role"] == "test"].groupby("object_id", sort=False):
        objects = part.groupby("instance")
        cell: dict[str, Any] = {"object_id": name, "n_instances": len(objects)}
        texts = [category_label(str(name))]
        for figure, decimals in (("log_likelihood", 2), ("error_deg", 1)):
            mean = _student(objects[figure].mean())
            cell |= mean.columns(figure)
            texts.append(interval_text(mean.value, mean.low, mean.high, decimals))
        cell["median_deg"] = part["error_deg"].median()
        cell["above_30"] = (part["error_deg"] > 30).mean()
        symmetry = solid(str(name))[1] if name in SOLIDS else ASYMMETRIC
        # With an axis of symmetry the bound depends on the grid.
        if symmetry.axis is None:
            cell["most"] = np.log(n_poses / VOLUME / len(symmetry.discrete))
        cells.append(cell)
        texts.insert(2, number(cell["most"]) if "most" in cell else "–")
        texts += [number(cell["median_deg"], 1), number(100 * cell["above_30"], 1)]
        rows.append(tuple(map(Cell, texts)))
    title = "One view in three dimensions"
    header = ("", "log-likelihood", "at most", "Error (°)", "median", "> 30° (%)")
    uniform = number(-np.log(VOLUME))
    notes = (
        f"Log density at the true pose, per π² of volume: the uniform one has {uniform}.",
        f"At most: of {n_poses:,} poses those that look the same have all probability.",
        "Errors are modulo symmetry. In brackets Student's 95 % interval over objects; a solid is "
        "one object, and the interval over parts of its images.",
    )
    frame = pd.DataFrame(cells)
    return Table("rotation_estimator", title, title, frame, header, (Part(tuple(rows)),), notes)


def _student(values: pd.Series) -> Interval:
    """Return the mean of values (n,) with Student's interval; its ends are NaN for one value."""
    return crossed_mean([values]).interval()

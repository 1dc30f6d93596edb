"""The table of the study `rotations`: pooled over objects, and object by object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.orientations.group import ASYMMETRIC, VOLUME, Symmetry
from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.statistics.metrics import Floats, Interval, percentile_interval
from nbv.labels import category_label, counted, interval_text, number
from nbv.tables.next_camera import MOST_VIEWS, CameraRecommendation
from nbv.tables.walks import ENDED, stopped
from studies.solids import SOLIDS, solid
from studies.trainings import crossed_mean

FIGURES = ("error_deg", "above_30", "n_views")
"""Means over the first views of every instance; an object's are the means over its instances."""

LESS = {
    "less_random": "− random",
    "less_opposite": "− opposite",
    "less_chance": "− stopped at random, the instance's mean number",
    "less_chance_overall": "− stopped at random, the overall mean number",
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


NUMBERS = {str(n): f"n_views == {n}" for n in range(1, MOST_VIEWS + 1)}
STOPS = {
    "decision": ENDED,
    "belief": f"probability >= {CameraRecommendation.STOP_PROBABILITY}",
    "score": "flip_ratio <= 0.5",
}
"""Queries of rows: the product's decision, its probability, and the score alone are enough."""

PROBABILITIES = {
    str(p): f"probability >= {p}" for p in (0.5, 0.7, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995)
}
"""Other probabilities that may be enough, for the figure."""


def method_errors(walks: pd.DataFrame) -> pd.DataFrame:
    """Return figures of each instance (index) and method; columns are (figure, method).

    Methods are ``<order>_<number of views>`` and ``<order>_<rule>``. Figures are `FIGURES`, and the
    error of the same order of views where the number of views is random, with the method's mean
    number of the instance (``chance``) or of all instances (``chance_overall``).
    """
    index = ["object_id", *(["training"] if "training" in walks else []), "instance"]
    walks = walks.assign(above_30=walks["error_deg"] > 30)
    figures = {}
    for order, rows in walks.groupby("order", sort=False):
        by_rule = {
            name: stopped(rows, rule).groupby(index)[[*FIGURES]].mean()
            for name, rule in (NUMBERS | STOPS | PROBABILITIES).items()
        }
        curve = np.stack([by_rule[number]["error_deg"] for number in NUMBERS], axis=1)
        for rule, means in by_rule.items():
            overall = means["n_views"].groupby(level="object_id").mean().mean()
            for name, at in (("chance", means["n_views"]), ("chance_overall", overall)):
                values = zip(np.broadcast_to(at, len(curve)), curve, strict=True)
                means[name] = [np.interp(n, range(1, MOST_VIEWS + 1), each) for n, each in values]
            figures[f"{order}_{rule}"] = means
    return pd.concat(figures, axis=1).swaplevel(axis=1)


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
            order, rule = str(method).split("_")
            others = {
                f"less_{other}": errors[f"{other}_{rule}"]
                for other in ("random", "opposite")
                if order not in ("random", other)
            }
            if rule not in NUMBERS:
                for name in ("chance", "chance_overall"):
                    others[f"less_{name}"] = of_group[name][method]
            less = {name: _mean(errors[method] - other, weights) for name, other in others.items()}
            cells.append(
                {"group": group, "method": method}
                | {name: figure.value for name, figure in mean.items()}
                | error.columns("error_deg", "ci")
                | {k: v for name, each in less.items() for k, v in each.columns(name).items()}
            )
            if rule in PROBABILITIES:
                continue
            differences = (less.get(name) for name in LESS)
            rows.append(
                (
                    Cell(f"{order}, {rule if rule in NUMBERS else f'until the {rule}'}"),
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
            "Stopped at random: the same order and the same mean number of views.",
            DECIDED,
        ),
    )


def reliability_table(walks: pd.DataFrame, groups: Mapping[str, Sequence[str]]) -> Table:
    """Return the product's probabilities and what came, in five parts of equal size.

    `walks` and `groups` are those of `orientation_table`; the views are in the recommended order.
    """
    walks = walks[walks["order"] == "recommended"]
    cells, parts = [], []
    for group, objects in groups.items():
        of_group = walks[walks["object_id"].isin(objects)].sort_values("probability", kind="stable")
        of_views = {"1": of_group[of_group["n_views"] == 1], "all": of_group}
        rows = []
        for part, name in enumerate(("least", "second", "middle", "fourth", "most")):
            row = [Cell(name)]
            for n_views, every in of_views.items():
                place = part * len(every) // 5, (part + 1) * len(every) // 5
                these = every.iloc[slice(*place)]
                right = (these["error_deg"] < CameraRecommendation.STOP_WITHIN_DEG).mean()
                cell = {"n": len(these), "said": these["probability"].mean(), "right": right}
                cells.append({"group": group, "n_views": n_views, "part": part + 1} | cell)
                row += [Cell(number(100 * cell[key], 1)) for key in ("said", "right")]
            rows.append(tuple(row))
        parts.append(Part(tuple(rows), group))
    title = f"Probability within {CameraRecommendation.STOP_WITHIN_DEG:g}°"
    header = ("Fifth", "1 view: said (%)", "right (%)", "all views: said (%)", "right (%)")
    notes = ("Fifths of first views, or of all views in the recommended order, by probability.",)
    frame = pd.DataFrame(cells)
    return Table("rotation_reliability", title, title, frame, header, tuple(parts), notes)


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

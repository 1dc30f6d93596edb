"""The table of the study `rotations`: pooled over objects, and object by object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.orientations.group import ASYMMETRIC, VOLUME, Symmetry
from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.statistics.metrics import Floats, Interval, percentile_interval
from nbv.labels import category_label, counted, interval_text, method_label, number
from studies.solids import SOLIDS, solid
from studies.trainings import crossed_mean

FIGURES = ("mean_deg", "median_deg", "above_30", "within_15")
"""Columns of every instance and method; an object's are the means over its instances."""
FUSION_LABELS = {
    "average": "averaged (Eq. 7)",
    "posterior": "posterior",
    "score": "posterior with scores",
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


def orientation_table(
    figures: pd.DataFrame,
    groups: Mapping[str, Sequence[str]],
    n_resamples: int,
    rng: np.random.Generator,
) -> Table:
    """Return the table of all methods, for each group of objects.

    Parameters
    ----------
    figures : DataFrame
        As of `studies.rotations.evaluate`; with a column ``training`` where each object is a
        category and its instances are judged by several trainings.
    groups : mapping
        Objects by the name of their group.
    n_resamples : int
        For the intervals.
    """
    parts, cells = [], []
    is_trained = "training" in figures
    by = ["object_id", "training", "instance"] if is_trained else ["object_id", "instance"]
    drawn = "each category's trainings" if is_trained else "objects"
    for group, objects in groups.items():
        of_group = figures["object_id"].isin(objects)
        for fusion, label in FUSION_LABELS.items():
            part = figures[of_group & (figures["fusion"] == fusion)]
            if part.empty:
                continue
            wide = {
                name: part.pivot_table(values=name, index=by, columns="method") for name in FIGURES
            }
            errors = wide["mean_deg"]
            weights = _resample(errors.index, rng, n_resamples)
            rows: list[Row] = []
            for method in part["method"].unique():
                mean = {name: _mean(wide[name][method], weights) for name in FIGURES}
                error = mean["mean_deg"]
                less = {
                    other: _mean(errors[method] - errors[other], weights)
                    for other in ("random", "opposite")
                }
                worse = _worse_objects(errors, method)
                cells.append(
                    {"group": group, "fusion": fusion, "method": method}
                    | {name: figure.value for name, figure in mean.items()}
                    | error.columns("mean_deg", "ci")
                    | less["random"].columns("less_random", "less_random_ci")
                    | less["opposite"].columns("less_opposite", "less_opposite_ci")
                    | {"worse_objects": " ".join(worse)}
                )
                rows.append(
                    (
                        Cell(method_label(method)),
                        Cell(interval_text(error.value, error.low, error.high, 1)),
                        *(difference_cell(d.value, d.low, d.high) for d in less.values()),
                        Cell(number(mean["median_deg"].value, 1)),
                        Cell(number(100 * mean["above_30"].value, 1)),
                        Cell(number(100 * mean["within_15"].value, 1)),
                        Cell(", ".join(worse) or "none"),
                    )
                )
            n_instances = part["instance"].nunique()
            n_objects = counted(part["object_id"].nunique(), "object")
            of = group if is_trained else f"{n_objects}, {group}"
            parts.append(Part(tuple(rows), f"{of}, {n_instances} instances, {label}"))
    header = ("Method", "Error (°)", "less random", "less opposite", "median", "> 30° (%)")
    title = "Two views in three dimensions"
    return Table(
        "rotations",
        title,
        title,
        pd.DataFrame(cells),
        (*header, "< 15° (%)", "worse than one view"),
        tuple(parts),
        (
            "Errors are modulo symmetry. Figures are means over objects of means over instances.",
            f"In brackets 95 % intervals: {n_resamples} resamples of {drawn}, then instances.",
            "An object is worse than with one view where Student's interval over its instances is.",
            DECIDED,
        ),
    )


def _worse_objects(errors: pd.DataFrame, method: str) -> list[str]:
    """Return the objects whose error is larger than that of one view, by Student's interval."""
    return [
        str(object_id)
        for object_id, rows in errors.groupby(level="object_id")
        if _student(rows[method] - rows["single"]).low > 0
    ]


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

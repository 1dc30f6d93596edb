"""The table of the study `rotations`: pooled over objects, and object by object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.core.orientations.group import ASYMMETRIC, VOLUME, Symmetry
from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.statistics.metrics import percentile_interval
from nbv.labels import category_label, counted, interval_text, method_label, number
from studies.solids import SOLIDS, solid

FIGURES = ("mean_deg", "median_deg", "above_30", "within_15")
"""Columns of every instance and method; an object's are the means over its instances."""
FUSION_LABELS = {
    "average": "averaged (Eq. 7)",
    "posterior": "posterior",
    "score": "posterior with scores",
}


@dataclass(frozen=True)
class _Sample:
    """A figure of every instance of some objects, and how often resamples draw each."""

    values: pd.DataFrame
    weights: NDArray[np.float64]

    def mean(self, method: str, less: str = "") -> tuple[float, float, float]:
        """Return the mean over objects of a method's figure, less another's, with its interval."""
        value = self.values[method] - (self.values[less] if less else 0.0)
        numbers = value.to_numpy(dtype=np.float64)
        objects = value.index.get_level_values("object_id")
        center = float(value.groupby(objects).mean().mean())
        return center, *percentile_interval(self.weights @ numbers)


def _sample(values: pd.DataFrame, rng: np.random.Generator, n_resamples: int) -> _Sample:
    """Draw units, then instances of each drawn unit, both with replacement.

    Units are the objects; of categories that have several trainings, the trainings of each.
    """
    index = values.index.to_frame(index=False)
    object_id = pd.factorize(index["object_id"])[0]
    is_trained = "training" in index
    unit = pd.factorize(index["training"])[0] if is_trained else object_id
    parts = object_id if is_trained else np.zeros(len(index), dtype=np.intp)
    members = [
        [np.flatnonzero((parts == part) & (unit == k)) for k in np.unique(unit[parts == part])]
        for part in np.unique(parts)
    ]
    weights = np.zeros((n_resamples, len(values)))
    for row in weights:
        for units in members:
            for k in rng.integers(len(units), size=len(units)):
                drawn = rng.choice(units[k], size=len(units[k]))
                np.add.at(row, drawn, 1 / (len(drawn) * len(units) * len(members)))
    return _Sample(values, weights)


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
        Of `studies.rotations.evaluate`; with a column ``training`` where each object is a category
        and its instances are judged by several trainings.
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
            draw = _sample(wide["mean_deg"], rng, n_resamples)
            rows: list[Row] = []
            for method in part["method"].unique():
                mean = {name: _Sample(wide[name], draw.weights).mean(method) for name in FIGURES}
                found: dict[str, object] = {"group": group, "fusion": fusion, "method": method}
                found |= {name: values[0] for name, values in mean.items()}
                found["ci_low"], found["ci_high"] = mean["mean_deg"][1:]
                less = {other: draw.mean(method, other) for other in ("random", "opposite")}
                for other, values in less.items():
                    names = (f"less_{other}{end}" for end in ("", "_ci_low", "_ci_high"))
                    found |= dict(zip(names, values, strict=True))
                worse = [one for one, d in _objects(wide["mean_deg"], method) if d[1] > 0]
                found["worse_objects"] = " ".join(worse)
                cells.append(found)
                rows.append(
                    (
                        Cell(method_label(method)),
                        Cell(interval_text(*mean["mean_deg"], decimals=1)),
                        *(difference_cell(*less[other]) for other in less),
                        Cell(number(mean["median_deg"][0], 1)),
                        Cell(number(100 * mean["above_30"][0], 1)),
                        Cell(number(100 * mean["within_15"][0], 1)),
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


def _objects(values: pd.DataFrame, method: str) -> list[tuple[str, tuple[float, float, float]]]:
    """Return each object's error less that of one view, with Student's interval."""
    return [
        (str(object_id), student(rows[method] - rows["single"]))
        for object_id, rows in values.groupby(level="object_id")
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
        found: dict[str, Any] = {"object_id": name, "n_instances": len(objects)}
        texts = [category_label(str(name))]
        for figure, decimals in (("log_likelihood", 2), ("error_deg", 1)):
            mean, low, high = student(objects[figure].mean())
            found |= {figure: mean, f"{figure}_low": low, f"{figure}_high": high}
            texts.append(interval_text(mean, low, high, decimals))
        found["median_deg"] = part["error_deg"].median()
        found["above_30"] = (part["error_deg"] > 30).mean()
        symmetry = solid(str(name))[1] if name in SOLIDS else ASYMMETRIC
        # With an axis of symmetry the bound depends on the grid.
        if symmetry.axis is None:
            found["most"] = np.log(n_poses / VOLUME / len(symmetry.discrete))
        cells.append(found)
        texts.insert(2, number(found["most"]) if "most" in found else "–")
        texts += [number(found["median_deg"], 1), number(100 * found["above_30"], 1)]
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


def student(values: ArrayLike) -> tuple[float, float, float]:
    """Return a mean with Student's interval, unbounded for one value."""
    from scipy import stats

    numbers = np.asarray(values, dtype=np.float64)
    half = np.inf
    if len(numbers) > 1:
        half = stats.t.ppf(0.975, len(numbers) - 1) * stats.sem(numbers)
    mean = float(numbers.mean())
    return mean, mean - half, mean + half

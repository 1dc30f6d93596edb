"""The table of the study `rotations`: pooled over objects, and object by object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.statistics.metrics import percentile_interval
from nbv.labels import interval_text, method_label, number

FIGURES = ("mean_deg", "median_deg", "above_30", "within_15")
"""Of every instance and method; an object's are the means over its instances."""

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
    """Draw objects, then instances of each drawn object, both with replacement."""
    objects = pd.factorize(values.index.get_level_values("object_id"))[0]
    members = [np.flatnonzero(objects == k) for k in range(objects.max() + 1)]
    weights = np.zeros((n_resamples, len(values)))
    for row in weights:
        for k in rng.integers(len(members), size=len(members)):
            drawn = rng.choice(members[k], size=len(members[k]))
            np.add.at(row, drawn, 1 / (len(drawn) * len(members)))
    return _Sample(values, weights)


def rotation_table(
    figures: pd.DataFrame, turning: Sequence[str], n_resamples: int, rng: np.random.Generator
) -> Table:
    """Return the table of all methods, for objects that turn freely about an axis and others.

    Parameters
    ----------
    figures : DataFrame
        Of `studies.rotations.evaluate`.
    turning : sequence of str
        Objects that turn freely.
    n_resamples : int
        For the intervals.
    """
    is_turning = figures["object_id"].isin(turning)
    groups = {"no symmetry or a discrete one": ~is_turning, "turning freely": is_turning}
    parts, cells = [], []
    for group, of_group in groups.items():
        for fusion, label in FUSION_LABELS.items():
            part = figures[of_group & (figures["fusion"] == fusion)]
            if part.empty:
                continue
            wide = {
                name: part.pivot_table(
                    values=name, index=["object_id", "instance"], columns="method"
                )
                for name in FIGURES
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
            n_objects = part["object_id"].nunique()
            heading = (
                f"{n_objects} objects, {group}, {part['instance'].nunique()} instances, {label}"
            )
            parts.append(Part(tuple(rows), heading))
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
            f"In brackets 95 % intervals: {n_resamples} resamples of objects, then instances.",
            "An object is worse than with one view where Student's interval over its instances is.",
            DECIDED,
        ),
    )


def _objects(values: pd.DataFrame, method: str) -> list[tuple[str, tuple[float, float, float]]]:
    """Return each object's error less that of one view, with Student's interval."""
    from scipy import stats

    found = []
    for object_id, rows in values.groupby(level="object_id"):
        less = (rows[method] - rows["single"]).to_numpy(dtype=np.float64)
        half = np.inf
        if len(less) > 1:
            half = stats.t.ppf(0.975, len(less) - 1) * less.std(ddof=1) / np.sqrt(len(less))
        found.append((str(object_id), (less.mean(), less.mean() - half, less.mean() + half)))
    return found

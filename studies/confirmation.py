"""Means of methods and their differences, by docs/reference/confirmation/protocol.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.errors import UserError
from studies.factorial import LIKELIEST, MORE_VIEWS, SINGLE, Factorial
from studies.object_errors import MEAN_COLUMNS, object_means
from studies.trainings import (
    Mean,
    crossed_mean,
    holm,
    predicted_by_others,
)

ALL = "all"
"""Stands for all categories together; all objects have equal weight."""
EQUALLY = "all, equally weighted"
"""The same with equal weight of categories, where they have different numbers of objects."""

GROUP = ("dataset", "category")
TRAINING = ("shuffle", "replicate")
METHOD = ("choice", "fusion", "n_views")
OBJECTS_COLUMNS = (*GROUP, *TRAINING, "fold", *METHOD, "object_id", *MEAN_COLUMNS)

METHODS_COLUMNS = (
    *GROUP,
    *METHOD,
    "mae_deg",
    "low",
    "high",
    "pauc",
    "above_90_percent",
    "travel_deg",
    "n_objects",
    "n_trainings",
)
CONTRASTS_COLUMNS = (
    *GROUP,
    "contrast",
    "fusion",
    "question",
    "difference_deg",
    "low",
    "high",
    "p_holm",
    "n_objects",
    "n_trainings",
)

PLANS_P_VALUES: Final[Mapping[tuple[str, str, int], float]] = {
    ("embedded-classifier", "airplane", 5): 0.01737,
    ("embedded-linear_classifier", "chair", 3): 0.00297,
    ("embedded-linear_classifier", "chair", 4): 9.7e-6,
    ("embedded-linear_classifier", "chair", 5): 0.1842,
    ("embedded-linear_classifier", "mug", 3): 8.0e-7,
    ("embedded-linear_classifier", "mug", 4): 4.9e-6,
    ("embedded-linear_classifier", "mug", 5): 0.00379,
    ("real-classifier", "airplane", 5): 0.00549,
    ("real-classifier", "chair", 4): 0.01906,
    ("real-linear_classifier", "chair", 3): 0.01722,
}
"""p-values of question 5 by data set, category and number of views, at commit 0624788.

That commit is the last one with plans. Their contrasts stay in Holm's family of their category, so
that the p-values of the others stay. Those absent here are 1 after Holm's method.
"""

BELIEF_COLUMNS = ("log_likelihood", "inside_50_percent", "inside_90_percent")
"""The quality of beliefs; see `studies.simulation.follow`."""

BELIEFS_COLUMNS = (
    *GROUP,
    *METHOD,
    "log_likelihood",
    "low",
    "high",
    *BELIEF_COLUMNS[1:],
    "n_objects",
    "n_trainings",
)
TRAININGS_COLUMNS = (
    *GROUP,
    "contrast",
    "fusion",
    *TRAINING,
    "difference_deg",
    "low",
    "high",
)

Method = tuple[str, str, int]
"""A choice, a fusion and a number of views."""


@dataclass(frozen=True)
class Contrast:
    """One method less another.

    Attributes
    ----------
    method, other : (str, str, int)
        Choice of views, fusion, number of views.
    question : int
        The question of the protocol that this contrast answers; 0 for none.
    """

    method: Method
    other: Method
    question: int = 0

    @property
    def name(self) -> str:
        """Such as ``expected_error - fixed``, with more than two views and a differing fusion."""
        views = f", {self.method[2]} views" if self.method[2] != 2 else ""
        fusion = f" ({self.other[1]})" if self.other[1] != self.method[1] else ""
        return f"{self.method[0]} - {self.other[0]}{fusion}{views}"


def contrasts_of(methods: Sequence[Method]) -> list[Contrast]:
    """Return the contrasts of the protocol between the given methods."""
    contrasts = []
    # Questions about a classifier are answered by the product, those of a regressor by averages.
    has_product = any(fusion == "product" for _, fusion, _ in methods)
    for fusion in dict.fromkeys(fusion for _, fusion, _ in methods):
        adaptive, paper = (("expected_error", fusion, 2), ("given_estimate", fusion, 2))
        opposite = ("opposite", fusion, 2)
        best_fixed = ("fixed", fusion, 2)
        answers = has_product == (fusion == "product")
        contrasts.append(Contrast(adaptive, best_fixed, question=1 if answers else 0))
        contrasts += [Contrast(adaptive, (other, fusion, 2)) for other in ("opposite", "random")]
        answers = fusion == "average" and not has_product
        contrasts.append(Contrast(paper, opposite, question=2 if answers else 0))
        contrasts.append(Contrast(paper, ("fixed", fusion, 2)))
    paper = ("given_estimate", "average", 2)
    contrasts += [
        Contrast(paper, ("none", "none", 1)),
        Contrast((*LIKELIEST, 2), paper, question=0 if has_product else 3),
        Contrast(("expected_error", "product", 2), paper, question=4),
        *(
            Contrast(("through_estimate", "average", 2), other, question=0 if has_product else 6)
            for other in (paper, *((name, "average", 2) for name in ("opposite", "given_truth")))
        ),
    ]
    for n_views in sorted({n for *_, n in methods if n > 2}):
        for fusion in ("posterior", "product"):
            even = ("evenly_spaced", fusion, n_views)
            contrasts.append(Contrast(("information_gain", fusion, n_views), even))
    known = set(methods)
    return [contrast for contrast in contrasts if {contrast.method, contrast.other} <= known]


def factorial_objects(made: Factorial, more_views: pd.DataFrame) -> pd.DataFrame:
    """Return the mean errors of every test object of one fold under every method.

    Columns `METHOD`, ``object_id`` and `MEAN_COLUMNS`: means over first views.
    """
    names = {f"{choice}/{fusion}": (choice, fusion) for choice, fusion in made.frames}
    means = object_means({name: made.frames[pair] for name, pair in names.items()})
    two = means.assign(
        choice=means["method"].map(lambda name: names[name][0]),
        fusion=means["method"].map(lambda name: names[name][1]),
        n_views=means["method"].map(lambda name: 1 if names[name] == SINGLE else 2),
    )
    more = _named(more_views[more_views["n_views"] > 2])
    columns = [*METHOD, "object_id", *MEAN_COLUMNS]
    return pd.concat([two[columns], more[columns]], ignore_index=True)


def factorial_beliefs(more_views: pd.DataFrame) -> pd.DataFrame:
    """Return the quality of beliefs for every test object of one fold, after one view and more.

    Columns `METHOD`, ``object_id`` and `BELIEF_COLUMNS`: means over first views. After one view
    the choice is ``none``.
    """
    rows = _named(more_views)
    first = (rows["n_views"] == 1) & (rows["choice"] == "evenly_spaced")
    kept = rows[first | (rows["n_views"] > 1)].copy()
    kept.loc[kept["n_views"] == 1, "choice"] = SINGLE[0]
    return kept[[*METHOD, "object_id", *BELIEF_COLUMNS]].reset_index(drop=True)


def _named(more_views: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the compared policies, with their choice and fusion."""
    rows = more_views[more_views["method"].isin(MORE_VIEWS)]
    return rows.assign(
        choice=lambda frame: frame["method"].map(lambda name: MORE_VIEWS[name][0]),
        fusion=lambda frame: frame["method"].map(lambda name: MORE_VIEWS[name][1]),
    )


def belief_means(beliefs: pd.DataFrame) -> pd.DataFrame:
    """Return the mean quality of beliefs over objects and trainings, columns `BELIEFS_COLUMNS`.

    Same parameters and errors as `method_means`, with `BELIEF_COLUMNS` instead of `MEAN_COLUMNS`.
    """
    return _means(beliefs, BELIEF_COLUMNS, BELIEFS_COLUMNS)


def method_means(objects: pd.DataFrame) -> pd.DataFrame:
    """Return the mean of every method over objects and trainings, columns `METHODS_COLUMNS`.

    Parameters
    ----------
    objects : DataFrame
        Columns `OBJECTS_COLUMNS`: one row per object, training and method.

    Raises
    ------
    UserError
        Where a training lacks an object or has it twice.
    """
    return _means(objects, MEAN_COLUMNS, METHODS_COLUMNS)


def _means(objects: pd.DataFrame, names: Sequence[str], columns: Sequence[str]) -> pd.DataFrame:
    """Return the means of the named columns, with an interval for the first one."""
    rows = []
    for group, tables in _tables(objects, names):
        for method, tables_by_name in tables.items():
            first, *others = (crossed_mean(*tables_by_name[name]) for name in names)
            interval = first.interval()
            means = (first.value, interval.low, interval.high, *(other.value for other in others))
            rows.append((*group, *method, *means, first.n_objects, first.n_trainings))
    return pd.DataFrame(rows, columns=list(columns))


def method_contrasts(objects: pd.DataFrame) -> pd.DataFrame:
    """Return differences of MAE between methods, columns `CONTRASTS_COLUMNS`.

    Paired by object and training. Same parameters and errors as `method_means`. Primary contrasts
    over all categories keep their p-values. All others are adjusted by Holm's method within a data
    set and category. Categories of different sizes are also pooled with equal weight (`EQUALLY`).
    """
    rows = []
    for group, tables in _tables(objects):
        sizes = {table.shape[1] for figures in tables.values() for table in figures["error_deg"]}
        rows += _contrast_rows(group, tables)
        if len(sizes) > 1:
            rows += _contrast_rows((group[0], EQUALLY), tables)
    return pd.DataFrame(rows, columns=list(CONTRASTS_COLUMNS))


def _contrast_rows(
    group: tuple[str, str], tables: Mapping[Method, Figures]
) -> list[tuple[str | int | float, ...]]:
    means: dict[Contrast, Mean] = {}
    for contrast in contrasts_of(list(tables)):
        mine, other = (tables[method]["error_deg"] for method in (contrast.method, contrast.other))
        differences = (a - b for a, b in zip(mine, other, strict=True))
        means[contrast] = crossed_mean(*differences, equal_categories=group[1] == EQUALLY)
    secondary = {
        contrast.name + contrast.method[1]: contrast
        for contrast in means
        if not (contrast.question and group[1] in (ALL, EQUALLY))
    }
    family = {name: means[contrast].p_value for name, contrast in secondary.items()}
    adjusted = holm(family | _plans_p_values(group, tables))
    rows: list[tuple[str | int | float, ...]] = []
    for contrast, mean in means.items():
        interval = mean.interval()
        p_value = adjusted.get(contrast.name + contrast.method[1], mean.p_value)
        rows.append(
            (
                *(*group, contrast.name, contrast.method[1], contrast.question),
                *(interval.value, interval.low, interval.high, p_value),
                *(mean.n_objects, mean.n_trainings),
            )
        )
    return rows


def _plans_p_values(group: tuple[str, str], methods: Iterable[Method]) -> dict[str, float]:
    """Return the p-values of question 5 that belong to a category's family, by a name each."""
    return {
        f"plan, {n_views} views": PLANS_P_VALUES.get((*group, n_views), 1.0)
        for choice, fusion, n_views in methods
        if (choice, fusion) == ("evenly_spaced", "product")
        if n_views > 2 and group[1] not in (ALL, EQUALLY)
    }


def training_contrasts(objects: pd.DataFrame) -> pd.DataFrame:
    """Return the contrasts of single trainings, columns `TRAININGS_COLUMNS`.

    ``low`` and ``high`` are the prediction of the other trainings
    (`studies.trainings.predicted_by_others`). Same parameters and errors as `method_means`.
    Categories with fewer than three trainings have no rows.
    """
    rows = []
    for (dataset, category), tables in _tables(objects):
        part = objects[objects["dataset"] == dataset]
        part = part if category == ALL else part[part["category"] == category]
        trainings = [key for key, _ in part.groupby(list(TRAINING))]
        for contrast in contrasts_of(list(tables)):
            mine, other = (
                tables[method]["error_deg"] for method in (contrast.method, contrast.other)
            )
            shown = predicted_by_others([a - b for a, b in zip(mine, other, strict=True)])
            names = (dataset, category, contrast.name, contrast.method[1])
            rows += [
                (*names, *training, mean.value, mean.low, mean.high)
                for training, mean in zip(trainings, shown, strict=bool(shown))
            ]
    return pd.DataFrame(rows, columns=list(TRAININGS_COLUMNS))


Figures = Mapping[str, Sequence[NDArray[np.float64]]]
"""By metric: tables (n_trainings, n_objects), one per category."""


def _tables(
    objects: pd.DataFrame, names: Sequence[str] = ("error_deg",)
) -> Iterator[tuple[tuple[str, str], dict[Method, Figures]]]:
    """Yield the tables of a data set by category, then of its categories together.

    Categories are joined only if all have the same trainings.
    """
    for dataset, rows in objects.groupby("dataset", sort=False):
        by_category = {
            str(category): _category_tables(part, f"{dataset}, {category}", names)
            for category, part in rows.groupby("category", sort=False)
        }
        for category, tables in by_category.items():
            yield (
                (str(dataset), category),
                {
                    method: {name: [table] for name, table in figures.items()}
                    for method, figures in tables.items()
                },
            )
        trainings = {
            frozenset(zip(*(part[name] for name in TRAINING), strict=True))
            for _, part in rows.groupby("category")
        }
        if len(by_category) > 1 and len(trainings) == 1:
            first, *rest = by_category.values()
            shared = [method for method in first if all(method in other for other in rest)]
            yield (
                (str(dataset), ALL),
                {
                    method: {
                        name: [tables[method][name] for tables in by_category.values()]
                        for name in names
                    }
                    for method in shared
                },
            )


def _category_tables(
    rows: pd.DataFrame, where: str, names: Sequence[str]
) -> dict[Method, dict[str, NDArray[np.float64]]]:
    tables: dict[Method, dict[str, NDArray[np.float64]]] = {}
    for (choice, fusion, n_views), part in rows.groupby(list(METHOD), sort=False):
        wide = part.set_index([*TRAINING, "object_id"])
        if wide.index.has_duplicates:
            raise UserError(f"{where}: an object is tested twice in a training; keep it again")
        method = (str(choice), str(fusion), int(str(n_views)))
        tables[method] = {}
        for name in names:
            table = wide[name].unstack("object_id")  # noqa: PD010 - nothing to aggregate
            if table.isna().to_numpy().any():
                raise UserError(f"{where}: a training lacks an object; finish all folds first")
            tables[method][name] = table.to_numpy(dtype=np.float64)
    return tables

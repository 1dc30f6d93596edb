"""The effect of each ingredient of the randomisation: bundles trained without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.bundles.evaluation import RECOMMENDED, SINGLE
from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.labels import category_label, counted, number
from studies.trainings import crossed_mean

ALL = ""
"""Key of the trainings that leave nothing out."""

_SHOWN = ((SINGLE, 1, "one view"), (RECOMMENDED, 2, "two views"))

Key = tuple[str, str]
"""Category and left-out ingredient."""
Replicates = Sequence[pd.DataFrame]
"""Results of `nbv.bundles.evaluation.evaluate` by training; every key has equally many."""


def ingredient_table(rendered: Mapping[Key, Replicates], real: Mapping[Key, Replicates]) -> Table:
    """Return the differences of errors between bundles without an ingredient and with all.

    Parameters
    ----------
    rendered : mapping of (str, str) to sequence of DataFrame
        Results on randomised test objects by category and left-out ingredient, `ALL` first.
    real : mapping
        Results on recordings of a real camera, or empty.
    """
    cells, rows = [], []
    for category, without in rendered:
        named = "with all" if without == ALL else f"without {without.replace('_', ' ')}"
        row = [Cell(f"{category_label(category)}, {named}")]
        made: dict[str, float | str] = {"category": category, "without": without or "nothing"}
        for choice, n_views, label in _SHOWN:
            errors = _object_errors(rendered[category, without], choice, n_views)
            key = label.replace(" ", "_")
            if without == ALL:
                value = float(errors.mean())
                made |= {key: value, f"{key}_low": np.nan, f"{key}_high": np.nan}
                row.append(Cell(f"{number(value)}°"))
            else:
                with_all = _object_errors(rendered[category, ALL], choice, n_views)
                difference = crossed_mean(errors - with_all).interval()
                made |= difference.columns(key)
                row.append(difference_cell(difference.value, difference.low, difference.high))
        for choice, n_views, label in _SHOWN if real else ():
            by_training = _object_errors(real[category, without], choice, n_views).mean(axis=1)
            key = f"{label.replace(' ', '_')}_real"
            made |= {
                key: float(by_training.mean()),
                f"{key}_least": float(by_training.min()),
                f"{key}_greatest": float(by_training.max()),
            }
            row.append(Cell(_spread(by_training)))
        cells.append(made)
        rows.append(tuple(row))
    n_trainings = len(next(iter(rendered.values())))
    return Table(
        "ingredients",
        "What is random in training",
        "What each ingredient of the randomisation brings",
        pd.DataFrame(cells),
        ("", *_titles("rendered")) + (tuple(_titles("real")) if real else ()),
        tuple(rows),
        (
            "Rendered: MAE on test objects of a view every 15°, with all that is random. Below the "
            f"first line it is the difference to it, with a 95 % interval {_over(n_trainings)}. "
            f"{DECIDED}",
            *((_real_note(n_trainings),) if real else ()),
        ),
    )


def _over(n_trainings: int) -> str:
    if n_trainings == 1:
        return "over objects; one training each, whose chance the interval does not contain"
    return f"over objects and {counted(n_trainings, 'training')} of the same images"


def _real_note(n_trainings: int) -> str:
    note = "Real: MAE on recordings with known azimuths"
    if n_trainings == 1:
        return f"{note}."
    return f"{note}, the mean over the trainings, and the least and greatest."


def _titles(what: str) -> Iterator[str]:
    return (f"{label}, {what}" for _, _, label in _SHOWN)


def _spread(by_training: NDArray[np.float64]) -> str:
    mean = f"{number(by_training.mean())}°"
    if len(by_training) == 1:
        return mean
    return f"{mean} ({number(by_training.min())} to {number(by_training.max())})"


def _object_errors(trainings: Replicates, choice: str, n_views: int) -> NDArray[np.float64]:
    """Return mean errors over the recordings of an object, (n_trainings, n_objects)."""
    means = []
    for rows in trainings:
        chosen = rows[(rows["choice"] == choice) & (rows["n_views"] == n_views)]
        means.append(chosen.groupby("object_id")["mae_deg"].mean())
    return pd.concat(means, axis=1).to_numpy(dtype=np.float64).T

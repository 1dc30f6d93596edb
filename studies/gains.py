"""What extensions gain over the paper's method and over the opposite view."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.object_means import mae_difference
from nbv.experiment.statistics.paired import Resampler
from nbv.labels import category_label, number
from studies.blocks import (
    CELL_COLUMNS,
    ORACLE,
    SELECTED,
    SUBJECT,
    Blocks,
    Methods,
    block_cell,
    method_with,
    shared_methods,
)

_COLUMNS = (
    ("Opposite", "opposite", ""),
    ("Proposed", "proposed", ""),
    ("Opposite, same fusion", "same_fusion", ""),
    ("Favoured", "favoured", ""),
    ("By fold", "selected", ""),
    ("Oracle", "oracle", ""),
    ("Favoured − Opposite, same fusion", "favoured", "same_fusion"),
    ("Favoured − Proposed", "favoured", "proposed"),
    ("By fold − Opposite, same fusion", "selected", "opposite_selected"),
    ("By fold − Proposed", "selected", "proposed"),
)
"""Each column's title and method and, where it is a difference, the other method."""


def favoured(choices: Mapping[str, pd.DataFrame], methods: Methods) -> dict[str, str]:
    """Return for each run the extension that its calibration objects favour as a whole.

    That is the one of least cross-validated error, averaged over folds and then over categories,
    without random views, oracles and those that take what is selected. A run whose errors were
    not cross-validated has none. ``choices`` has by run the folds' ``choices.csv``.
    """
    candidates = [
        name
        for name, method in methods.items()
        if method["policy"] not in ("random", ORACLE) and SELECTED not in method.values()
    ]
    best = {}
    for run, rows in choices.items():
        own = rows[rows["method"].isin(candidates)]
        errors = own.groupby(["category", "method"])["validated_error_deg"].mean()
        means = errors.groupby("method").mean().dropna()
        if len(means):
            best[run] = str(means.idxmin())
    return best


def extension_gains_table(
    blocks: Blocks,
    choices: Mapping[str, pd.DataFrame],
    methods: Methods,
    resampler: Resampler,
) -> Table:
    """Return what extensions gain, block by block.

    Columns of methods that the configuration lacks are left out; `favoured` explains ``choices``.
    """
    present = shared_methods(blocks, methods)
    known = {name: method for name, method in methods.items() if name in present}
    best = favoured(choices, known)
    by_run = {run: _named_methods(known, best.get(run)) for run, _ in blocks}
    shown = [
        (title, mine, other)
        for title, mine, other in _COLUMNS
        if any({mine, other or mine} <= named.keys() for named in by_run.values())
    ]
    cells, rows = [], []
    for block, sample in blocks.items():
        run, category = block
        row, named = [Cell(f"{category_label(category)} ({run})")], by_run[run]
        for _, mine, other in shown:
            method, versus = named.get(mine), named.get(other)
            if method is None or (other and versus is None):
                row.append(Cell("–"))
                continue
            made = block_cell(block, method, sample, resampler)
            if versus is None:
                row.append(Cell(number(made["value"])))
            else:
                found = mae_difference(sample, method, versus, resampler)
                made |= {"versus": versus, **found.columns("difference")}
                row.append(difference_cell(found.value, found.low, found.high))
            cells.append(made)
        rows.append(tuple(row))
    header = ("Category", *(title for title, _, _ in shown))
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    title = "What extensions gain"
    return Table("extension_gains", title, title, frame, header, tuple(rows), _notes(best, header))


def _named_methods(methods: Methods, best: str | None) -> dict[str, str]:
    """Return the methods that a run's columns are about; absent ones are left out."""
    fusion = methods[best].get("fusion", "average") if best else ""
    named = {
        "opposite": method_with(methods, "opposite", "average"),
        "proposed": SUBJECT if SUBJECT in methods else None,
        "same_fusion": method_with(methods, "opposite", fusion),
        "favoured": best,
        "selected": method_with(methods, SELECTED, SELECTED),
        "opposite_selected": method_with(methods, "opposite", SELECTED),
        "oracle": method_with(methods, ORACLE, "posterior"),
    }
    return {key: name for key, name in named.items() if name is not None}


def _notes(best: Mapping[str, str], header: tuple[str, ...]) -> tuple[str, ...]:
    named = ", ".join(f"{run}: {name.replace('_', ' ')}" for run, name in best.items())
    notes = {
        "Favoured": "Favoured: the criterion and fusion of least cross-validated error on the "
        f"calibration objects of all folds and categories ({named}).",
        "By fold": "By fold: in each fold and category the most cautious criterion and fusion "
        "whose error, cross-validated on the fold's few calibration objects, is not surely above "
        "the least.",
        "Category": f"Differences are paired by object, with 95 % intervals. {DECIDED}",
        "Oracle": "Oracle: the best rotation for each image given the truth, with posterior "
        "fusion.",
    }
    first, *others = (text for title, text in notes.items() if title in header)
    return (f"MAE in degrees. {first}", *others)

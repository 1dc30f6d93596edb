"""What extensions gain over the paper's method and over the opposite view."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from nbv.labels import category_label, number
from nbv.reporting.extensions.blocks import (
    CELL_COLUMNS,
    ORACLE,
    SELECTED,
    SUBJECT,
    Blocks,
    Methods,
    block_cell,
    difference_cell,
    method_with,
    shared_methods,
)
from nbv.reporting.table import Cell, Table
from nbv.statistics.object_means import mae_difference
from nbv.statistics.paired import Resampler

_OPPOSITE, _SAME_FUSION, _FAVOURED = "Opposite", "Opposite, same fusion", "Favoured"
_BY_FOLD, _ITS_OPPOSITE, _PROPOSED = "By fold", "Opposite by fold", "Proposed"


def favoured(choices: Mapping[str, pd.DataFrame], methods: Methods) -> dict[str, str]:
    """Return for each run the extension that its calibration objects favour as a whole.

    Parameters
    ----------
    choices : mapping of str to DataFrame
        By run, from `nbv.statistics.object_means.load_choices`.
    methods : mapping of str to mapping
        ``policy`` and ``fusion`` of the configuration's extensions.

    Returns
    -------
    dict of str to str
        The extension of least cross-validated error, averaged over folds and then over
        categories, without random views, oracles and those that take what is selected. A run
        whose errors were not cross-validated has none.
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

    Columns of methods that the configuration lacks are left out.

    Parameters
    ----------
    blocks : mapping of (run, category) to PairedErrors
        From `blocks_of`.
    choices : mapping of str to DataFrame
        By run, from `nbv.statistics.object_means.load_choices`.
    methods : mapping of str to mapping
        ``policy`` and ``fusion`` of the configuration's methods and extensions.
    resampler : Resampler
    """
    present = shared_methods(blocks, methods)
    known = {name: method for name, method in methods.items() if name in present}
    best = favoured(choices, known)
    by_run = {run: _named_methods(known, best.get(run)) for run, _ in blocks}
    columns = _columns({title for named in by_run.values() for title in named})
    cells, rows = [], []
    for block, sample in blocks.items():
        run, category = block
        row = [Cell(f"{category_label(category)} ({run})")]
        for title, versus_title in columns:
            method, versus = by_run[run].get(title), by_run[run].get(versus_title)
            if method is None or (versus_title and versus is None):
                row.append(Cell("–"))
                continue
            made = block_cell(block, method, sample, resampler)
            if versus is None:
                row.append(Cell(number(sample.errors_deg[method].mean())))
            else:
                found = mae_difference(sample, method, versus, resampler)
                made |= {"versus": versus, **found.columns("difference")}
                row.append(difference_cell(found))
            cells.append(made)
        rows.append(tuple(row))
    header = ("Category", *(_header(*column) for column in columns))
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    title = "What extensions gain"
    notes = _notes(best, {title for title, _ in columns})
    return Table("extension_gains", title, title, frame, header, tuple(rows), notes)


def _named_methods(methods: Methods, best: str | None) -> dict[str, str]:
    """Return the methods that a run's columns are about, by title; absent ones are left out."""
    fusion = methods[best].get("fusion", "average") if best else ""
    named = {
        _OPPOSITE: method_with(methods, "opposite", "average"),
        _PROPOSED: SUBJECT if SUBJECT in methods else None,
        _SAME_FUSION: method_with(methods, "opposite", fusion),
        _FAVOURED: best,
        _BY_FOLD: method_with(methods, SELECTED, SELECTED),
        _ITS_OPPOSITE: method_with(methods, "opposite", SELECTED),
        "Oracle": method_with(methods, ORACLE, "posterior"),
    }
    return {title: name for title, name in named.items() if name is not None}


def _columns(titles: set[str]) -> list[tuple[str, str]]:
    """Return the titles of each column's method and, for a difference, of the other's."""
    values = (_OPPOSITE, _PROPOSED, _SAME_FUSION, _FAVOURED, _BY_FOLD, "Oracle")
    differences = (
        (_FAVOURED, _SAME_FUSION),
        (_FAVOURED, _PROPOSED),
        (_BY_FOLD, _ITS_OPPOSITE),
        (_BY_FOLD, _PROPOSED),
    )
    return [(title, "") for title in values if title in titles] + [
        pair for pair in differences if titles.issuperset(pair)
    ]


def _header(title: str, versus: str) -> str:
    other = _SAME_FUSION if versus == _ITS_OPPOSITE else versus
    return f"{title} − {other}" if versus else title


def _notes(best: Mapping[str, str], titles: set[str]) -> tuple[str, ...]:
    named = ", ".join(f"{run}: {name.replace('_', ' ')}" for run, name in best.items())
    of_title = {
        _FAVOURED: "Favoured: the criterion and fusion of least cross-validated error on the "
        f"calibration objects of all folds and categories ({named}).",
        _BY_FOLD: "By fold: in each fold and category the most cautious criterion and fusion whose "
        "error, cross-validated on the fold's few calibration objects, is not surely above the "
        "least.",
        "": "Differences are paired by object, with 95 % intervals; bold where they are below 0 "
        "and the interval excludes it.",
        "Oracle": "Oracle: the best rotation for each image given the truth, with posterior "
        "fusion.",
    }
    shown = [text for title, text in of_title.items() if not title or title in titles]
    return (f"MAE in degrees. {shown[0]}", *shown[1:])

"""All methods on all data sets, and whether what goes beyond the paper is worth it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from nbv.labels import category_label, interval_text, number
from nbv.reporting.grid import Cell, Grid
from nbv.reporting.sheets import Sheet
from nbv.statistics.metrics import Interval
from nbv.statistics.object_means import indistinct_from_best, paired_objects
from nbv.statistics.object_means import mae_difference as gap
from nbv.statistics.object_means import mae_interval as standing
from nbv.statistics.paired import PairedErrors, Resampler

Block = tuple[str, str]
"""A run and a category: what methods are ranked within."""

BOUND = "oracle"
CELL_COLUMNS = (
    "run",
    "category",
    "method",
    "value",
    "ci_low",
    "ci_high",
    "among_best",
    "versus",
    "difference",
    "difference_low",
    "difference_high",
    "n_objects",
)


def blocks_of(
    runs: Mapping[str, pd.DataFrame], elevation_deg: int = 0
) -> dict[Block, PairedErrors]:
    """Return the objects' errors of each run and category at its reference elevation.

    Parameters
    ----------
    runs : mapping of str to DataFrame
        From `nbv.statistics.object_means.load_object_means`, by the run's name.
    elevation_deg : int
        A category's lowest elevation stands in where it was not run.
    """
    blocks = {}
    for run, means in runs.items():
        for category, rows in means.groupby("category", sort=False):
            present = rows["elevation_deg"].unique()
            chosen = elevation_deg if elevation_deg in present else present.min()
            at = rows[rows["elevation_deg"] == chosen]
            blocks[run, str(category)] = paired_objects(at, str(category))
    return blocks


def leaderboard(blocks: Mapping[Block, PairedErrors], resampler: Resampler) -> Sheet:
    """Return the MAE of every method in every block, with mean ranks and a rank test.

    Bold is the best of a column where the interval of its difference to every other method
    excludes 0; otherwise all that cannot be told from the best are marked with an asterisk.
    Oracles are bounds and take no part.
    """
    methods = _shared_methods(blocks)
    competing = [m for m in methods if not m.startswith(BOUND)]
    cells, texts = [], {method: [Cell(method.replace("_", " "))] for method in methods}
    for (run, category), sample in blocks.items():
        best = indistinct_from_best(sample, competing, resampler)
        for method in methods:
            found = standing(sample, method, resampler)
            versus = "opposite" if method != "opposite" else "proposed"
            cells.append(
                _cell(run, category, method, found, sample)
                | {"among_best": method in best, "versus": versus}
                | _difference(gap(sample, method, versus, resampler))
            )
            sole = best == [method]
            mark = "*" if method in best and not sole else ""
            texts[method].append(Cell(f"{number(found.value)}{mark}", sole))
    ranks = _ranks(blocks, competing)
    for method in methods:
        mean = ranks[:, competing.index(method)].mean() if method in competing else np.nan
        texts[method].append(Cell(number(mean)))
    order = sorted(competing, key=lambda m: ranks[:, competing.index(m)].mean())
    order += [method for method in methods if method not in competing]
    header = ["Method", *(f"{category_label(c)} ({r})" for r, c in blocks), "Mean rank"]
    grid = Grid(tuple(header), tuple(tuple(texts[method]) for method in order))
    notes = (
        "MAE in degrees over test images of all folds, at the reference elevation.",
        "Bold: below every other method, the 95 % interval over objects excluding 0. "
        "*: cannot be told from the lowest of its column. Oracles know the truth: a bound.",
        *_rank_notes(blocks, competing, ranks),
    )
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    return Sheet("leaderboard", "Leaderboard", frame, grid, notes)


def favoured(choices: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Return for each run the contender that its calibration objects favour as a whole.

    Parameters
    ----------
    choices : mapping of str to DataFrame
        By run: ``category`` and the columns of `choices_frame`, all folds.

    Returns
    -------
    dict of str to str
        The contender of least cross-validated error, averaged over folds and then over
        categories; followers of others' choices and oracles take no part.
    """
    best = {}
    for run, rows in choices.items():
        own = ~rows["method"].str.contains("chosen") & (rows["rotation"] != BOUND)
        own &= rows["rotation"] != "random"
        errors = rows[own].groupby(["category", "method"])["validated_error_deg"].mean()
        best[run] = str(errors.groupby("method").mean().idxmin())
    return best


def beyond(
    blocks: Mapping[Block, PairedErrors],
    pairs: Mapping[str, tuple[str, str]],
    resampler: Resampler,
) -> Sheet:
    """Return what going beyond the paper gains, block by block.

    Parameters
    ----------
    blocks : mapping
        From `blocks_of`.
    pairs : mapping of str to (str, str)
        By run: the contender that calibration objects favour as a whole, and Opposite with the
        same fusion.
    resampler : Resampler
    """
    cells, rows = [], []
    for (run, category), sample in blocks.items():
        row = [Cell(f"{category_label(category)} ({run})")]
        best, same_fusion = pairs[run]
        for method in ("opposite", "proposed", same_fusion, best, "chosen", "oracle_posterior"):
            found = standing(sample, method, resampler)
            cells.append(_cell(run, category, method, found, sample))
            row.append(Cell(number(found.value)))
        for method, versus in (
            (best, same_fusion),
            (best, "proposed"),
            ("chosen", "opposite_chosen"),
            ("chosen", "proposed"),
        ):
            found = gap(sample, method, versus, resampler)
            mine = _cell(run, category, method, standing(sample, method, resampler), sample)
            cells.append(mine | {"versus": versus} | _difference(found))
            text = interval_text(found.value, found.low, found.high)
            row.append(Cell(text, best=found.high < 0.0))
        rows.append(tuple(row))
    header = (
        "Category",
        "Opposite",
        "Proposed",
        "Opposite, same fusion",
        "Favoured",
        "By fold",
        "Oracle",
        "Favoured − Opposite, same fusion",
        "Favoured − Proposed",
        "By fold − Opposite, same fusion",
        "By fold − Proposed",
    )
    named = ", ".join(f"{run}: {best.replace('_', ' ')}" for run, (best, _) in pairs.items())
    notes = (
        f"MAE in degrees. Favoured: the criterion and fusion of least cross-validated error on the "
        f"calibration objects of all folds and categories ({named}).",
        "By fold: in each fold and category the most cautious criterion and fusion whose error, "
        "cross-validated on the fold's few calibration objects, is not surely above the least.",
        "Differences are paired by object, with 95 % intervals; bold where they are below 0 and "
        "the interval excludes it.",
        "Oracle: the best rotation for each image given the truth, with posterior fusion.",
    )
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    return Sheet("beyond", "Beyond the paper", frame, Grid(header, tuple(rows)), notes)


def _cell(
    run: str, category: str, method: str, found: Interval, sample: PairedErrors
) -> dict[str, object]:
    return dict.fromkeys(CELL_COLUMNS, np.nan) | {
        "run": run,
        "category": category,
        "method": method,
        "value": found.value,
        "ci_low": found.low,
        "ci_high": found.high,
        "n_objects": sample.n_objects,
    }


def _difference(found: Interval) -> dict[str, float]:
    return {
        "difference": found.value,
        "difference_low": found.low,
        "difference_high": found.high,
    }


def _shared_methods(blocks: Mapping[Block, PairedErrors]) -> list[str]:
    first = next(iter(blocks.values()))
    return [m for m in first.errors_deg if all(m in s.errors_deg for s in blocks.values())]


def _ranks(blocks: Mapping[Block, PairedErrors], methods: Sequence[str]) -> NDArray[np.float64]:
    """Return each method's rank in each block, (n_blocks, n_methods), 1 the lowest MAE."""
    table = [[sample.errors_deg[m].mean() for m in methods] for sample in blocks.values()]
    return np.asarray(stats.rankdata(np.round(table, 6), axis=1))


def _rank_notes(
    blocks: Mapping[Block, PairedErrors], methods: Sequence[str], ranks: NDArray[np.float64]
) -> list[str]:
    if len(blocks) < 3 or len(methods) < 3:
        return []
    friedman = stats.friedmanchisquare(*ranks.T)
    notes = [
        f"Friedman test over {len(blocks)} columns that all methods rank alike: "
        f"p = {friedman.pvalue:.2g}."
    ]
    for method, versus in (("chosen", "opposite_chosen"), ("chosen", "proposed")):
        if method in methods and versus in methods:
            gaps = [
                s.errors_deg[method].mean() - s.errors_deg[versus].mean() for s in blocks.values()
            ]
            if np.any(gaps):
                test = stats.wilcoxon(gaps)
                notes.append(
                    f"Wilcoxon signed-rank test over columns, {method} against "
                    f"{versus.replace('_', ' ')}: p = {test.pvalue:.2g} (with {len(gaps)} columns "
                    f"no less than {2 ** (1 - len(gaps)):.2g} is possible)."
                )
    return notes

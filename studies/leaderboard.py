"""The leaderboard: all methods on all data sets.

Methods are compared within a block: the objects' errors of one run and category. The
configuration's methods and extensions come as one mapping of a name to its ``policy`` and
``fusion``, by default the average.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from nbv.experiment.report.table import Cell, Table
from nbv.experiment.statistics.metrics import Floats
from nbv.experiment.statistics.paired import PairedErrors, Resampler
from nbv.labels import category_label, number
from studies.object_errors import indistinct_from_best, mae_difference, mae_interval, paired_objects

Block = tuple[str, str]
"""A run and a category."""

Blocks = Mapping[Block, PairedErrors]
Methods = Mapping[str, Mapping[str, str]]

_ORACLE = "oracle"
_SELECTED = "selected"
_SUBJECT = "proposed"

_COLUMNS = (
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
    """Return the objects' errors by run and category at the reference elevation.

    A category that was not run there is taken at its lowest elevation. ``runs`` maps the name of a
    run to its ``objects.csv`` files, read by `studies.object_errors.load_folds`.
    """
    blocks = {}
    for run, means in runs.items():
        for category, rows in means.groupby("category", sort=False):
            present = rows["elevation_deg"].unique()
            taken = elevation_deg if elevation_deg in present else present.min()
            at = rows[rows["elevation_deg"] == taken]
            blocks[run, str(category)] = paired_objects(at, str(category))
    return blocks


def leaderboard_table(blocks: Blocks, methods: Methods, resampler: Resampler) -> Table:
    """Return the MAE of every method in every block, with mean ranks and a rank test.

    The lowest of a column is bold. An asterisk marks values whose interval of the difference to it
    lies above 0. Oracles are bounds and are not ranked.
    """
    shown = _shared_methods(blocks, methods)
    ranked = [method for method in shown if methods[method]["policy"] != _ORACLE]
    opposite = _method_with(methods, "opposite", "average")
    cells, texts = [], {method: [Cell(method.replace("_", " "))] for method in shown}
    for block, sample in blocks.items():
        best = indistinct_from_best(sample, ranked, resampler)
        for method in shown:
            made = _block_cell(block, method, sample, resampler) | {"among_best": method in best}
            versus = opposite if method != opposite else _SUBJECT
            if versus in shown:
                difference = mae_difference(sample, method, versus, resampler)
                made |= {"versus": versus, **difference.columns("difference")}
            cells.append(made)
            above = method in ranked and method not in best
            lowest = method == best[0]
            texts[method].append(Cell(number(made["value"]), lowest, "*" if above else ""))
    errors = np.array([[s.errors_deg[m].mean() for m in ranked] for s in blocks.values()])
    ranks = stats.rankdata(np.round(errors, 6), axis=1)  # 1: the lowest MAE of a block
    mean_rank = dict(zip(ranked, ranks.mean(axis=0), strict=True))
    order = sorted(shown, key=lambda method: mean_rank.get(method, np.inf))
    header = ("Method", *(f"{category_label(c)} ({r})" for r, c in blocks), "Mean rank")
    rows = [(*texts[m], Cell(number(mean_rank.get(m, np.nan)))) for m in order]
    notes = (
        "MAE in degrees over test images of all folds, at the reference elevation.",
        "Bold: the lowest of its column. *: the 95 % interval over objects of the difference to it "
        "excludes 0. Oracles know the truth: they are bounds and are not ranked.",
        *_rank_notes(methods, dict(zip(ranked, errors.T, strict=True)), ranks),
    )
    frame = pd.DataFrame(cells, columns=list(_COLUMNS))
    return Table("leaderboard", "Leaderboard", "Leaderboard", frame, header, tuple(rows), notes)


def _rank_notes(methods: Methods, mae: Mapping[str, Floats], ranks: Floats) -> Iterator[str]:
    n_blocks = len(ranks)
    if n_blocks < 3 or len(mae) < 3:
        return
    friedman = stats.friedmanchisquare(*ranks.T)
    yield (
        f"Friedman test over {n_blocks} columns that all methods rank alike: "
        f"p = {friedman.pvalue:.2g}."
    )
    selected = _method_with(methods, _SELECTED, _SELECTED)
    for versus in (_method_with(methods, "opposite", _SELECTED), _SUBJECT):
        if selected and versus and {selected, versus} <= mae.keys():
            gaps = mae[selected] - mae[versus]
            if gaps.any():
                yield (
                    f"Wilcoxon signed-rank test over columns, {selected.replace('_', ' ')} against "
                    f"{versus.replace('_', ' ')}: p = {stats.wilcoxon(gaps).pvalue:.2g} (with "
                    f"{n_blocks} columns no less than {2 ** (1 - n_blocks):.2g} is possible)."
                )


def _shared_methods(blocks: Blocks, methods: Methods) -> list[str]:
    """Return the methods of the configuration that every block has.

    Duplicates of a policy and fusion are ranked once, by the first name.
    """
    first = next(iter(blocks.values()))
    everywhere = [m for m in first.errors_deg if all(m in s.errors_deg for s in blocks.values())]
    named = {
        _method_with(methods, m["policy"], m.get("fusion", "average")) for m in methods.values()
    }
    return [method for method in everywhere if method in named]


def _method_with(methods: Methods, policy: str, fusion: str) -> str | None:
    """Return the first method that has a policy and a fusion, or None."""
    for name, method in methods.items():
        if (method["policy"], method.get("fusion", "average")) == (policy, fusion):
            return name
    return None


def _block_cell(
    block: Block, method: str, sample: PairedErrors, resampler: Resampler
) -> dict[str, Any]:
    """Return the tidy cell of a method's MAE in a block."""
    run, category = block
    return (
        dict.fromkeys(_COLUMNS, np.nan)
        | {"run": run, "category": category, "method": method, "n_objects": sample.n_objects}
        | mae_interval(sample, method, resampler).columns("value", "ci")
    )

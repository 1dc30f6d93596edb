"""All methods on all data sets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from scipy import stats

from nbv.experiment.report.table import Cell, Table
from nbv.experiment.statistics.metrics import Floats
from nbv.experiment.statistics.object_means import indistinct_from_best, mae_difference
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


def leaderboard_table(blocks: Blocks, methods: Methods, resampler: Resampler) -> Table:
    """Return the MAE of every method in every block, with mean ranks and a rank test.

    Bold is the lowest of a column. An asterisk marks what is above it with the whole interval of
    the difference. Oracles are bounds and are not ranked.
    """
    shown = shared_methods(blocks, methods)
    ranked = [method for method in shown if methods[method]["policy"] != ORACLE]
    opposite = method_with(methods, "opposite", "average")
    cells, texts = [], {method: [Cell(method.replace("_", " "))] for method in shown}
    for block, sample in blocks.items():
        best = indistinct_from_best(sample, ranked, resampler)
        for method in shown:
            made = block_cell(block, method, sample, resampler) | {"among_best": method in best}
            versus = opposite if method != opposite else SUBJECT
            if versus in shown:
                found = mae_difference(sample, method, versus, resampler)
                made |= {"versus": versus, **found.columns("difference")}
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
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
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
    selected = method_with(methods, SELECTED, SELECTED)
    for versus in (method_with(methods, "opposite", SELECTED), SUBJECT):
        if selected and versus and {selected, versus} <= mae.keys():
            gaps = mae[selected] - mae[versus]
            if gaps.any():
                yield (
                    f"Wilcoxon signed-rank test over columns, {selected.replace('_', ' ')} against "
                    f"{versus.replace('_', ' ')}: p = {stats.wilcoxon(gaps).pvalue:.2g} (with "
                    f"{n_blocks} columns no less than {2 ** (1 - n_blocks):.2g} is possible)."
                )

"""Compare a run with reference results.

Two runs of one configuration have the same objects, folds and seeds. On one machine they give the
same bytes. On two machines floating point differs, which amounts to retraining every estimator: the
figures move, though mostly less than with other objects, which their intervals account for. Hence
these tolerances for each cell of the tables' tidy CSV files:

===================  ===============================================================================
a statistic          the new value lies in the reference's 95 % interval, or the reference's value
                     in the new one
a paired difference  the 95 % intervals of reference and run have a point in common: pairing takes
                     out what objects do to all methods alike, but not what retraining does to each
σ over k folds       the ratio lies in the 95 % range of two independent sets of k folds (F
                     distribution; 0.32 to 3.1 for five folds); not judged for the share of errors
                     above 90°, which is 0 in many folds, so that a few images decide its σ
examples (Table 6)   not judged: one object, which may differ after retraining
counts of objects    equal
verdicts of claims   reported where they changed; a failure where "holds" became "does not hold", or
                     the reverse
===================  ===============================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from scipy import stats

from nbv.experiment.config import read_configuration
from nbv.experiment.paper.published import SIGMA_ROW
from nbv.experiment.paper.statements import FAILS, HOLDS
from nbv.experiment.report.settings import CELL_COLUMNS, TRANSFER
from nbv.experiment.report.tables import ABOVE_90
from nbv.experiment.run.reference import (
    CELL_KEY,
    CellRecord,
    SettingDifference,
    differing_settings,
    differing_surroundings,
    other_settings,
    read_cells,
    read_verdicts,
    table_files,
)
from nbv.labels import method_label, number

IDENTICAL, WITHIN, OUTSIDE, UNJUDGED = "identical", "within", "outside", "not judged"

# The cell (table, row, row_label, method, metric), one of its figures, and how it was judged.
JUDGED_COLUMNS = (*CELL_COLUMNS[:5], "quantity", "reference", "low", "high", "here", "status")
_EXAMPLE_METRICS = frozenset({"estimate", "error"})
_METRIC_LABELS = {"mae": "MAE", "pauc": "pAUC", "above_90_percent": "errors above 90°"}
_COUNTS = {"n_objects": "test objects", "n_images": "initial views"}


@dataclass(frozen=True)
class RunComparison:
    """The agreement of a run with a reference, and the differences.

    `cells` has the `JUDGED_COLUMNS`, and a row for every figure in the cells that both have.
    ``quantity`` is ``value``, ``difference`` or ``sigma``; ``here`` may lie between ``low`` and
    ``high`` (NaN where it is not judged); ``status`` is ``identical`` to the last written digit,
    ``within``, ``outside`` or ``not judged``. `settings` affect results and differ. Each
    contradiction of the reference is a line of `problems`, every other difference one of `remarks`.
    """

    reference: Path
    run: Path
    cells: pd.DataFrame
    settings: tuple[SettingDifference, ...]
    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    n_claims: int

    @property
    def agrees(self) -> bool:
        """Whether the run has the reference's settings and confirms its results."""
        return not self.settings and not self.problems

    def summary_line(self) -> str:
        """Return the numbers of cells that are identical, within their tolerance, or outside."""
        by_cell = self.cells.groupby(["table", *CELL_KEY], sort=False)["status"].agg(set)
        counts = dict.fromkeys((IDENTICAL, WITHIN, OUTSIDE, UNJUDGED), 0)
        for statuses in by_cell:
            worst = next(s for s in (OUTSIDE, UNJUDGED, WITHIN, IDENTICAL) if s in statuses)
            counts[worst] += 1
        return (
            f"{len(by_cell)} cells and {self.n_claims} claims compared: {counts[IDENTICAL]} cells "
            f"identical, {counts[WITHIN]} within their tolerance, {counts[OUTSIDE]} outside, "
            f"{counts[UNJUDGED]} not judged"
        )

    def lines(self) -> list[str]:
        """Return the comparison as text: settings, problems, remarks, counts and the verdict."""
        verb = "agrees" if self.agrees else "does not agree"
        settings = [other_settings(self.reference, self.settings)] if self.settings else []
        judgement = f"{self.run} {verb} with {self.reference}"
        return [*settings, *self.problems, *self.remarks, self.summary_line(), judgement]


def compare_runs(reference: Path, run: Path) -> RunComparison:
    """Compare a run's tables and claims with a reference's.

    The reference may be another run. The comparison is complete even where the settings differ.
    Raise UserError if one of the folders lacks a configuration, or the reference its tables or
    claims.
    """
    known, ours = read_configuration(reference), read_configuration(run)
    factor = sigma_ratio(int(known["n_folds"]))
    problems: list[str] = []
    remarks = differing_surroundings(reference, run, known, ours)
    judged: list[CellRecord] = []
    for path in table_files(reference):
        other = run / "tables" / path.name
        if not other.is_file():
            (remarks if path.stem == TRANSFER else problems).append(f"{path.stem}: missing")
            continue
        theirs, mine = read_cells(path), read_cells(other)
        problems += [f"{path.stem}, {text}: missing" for text in _unmatched(theirs, mine)]
        remarks += [
            f"{path.stem}, {text}: not in the reference" for text in _unmatched(mine, theirs)
        ]
        pairs = [(cell, mine[key]) for key, cell in theirs.items() if key in mine]
        problems += _differing_counts(pairs)
        judged += [row for pair in pairs for row in judge_cell(*pair, factor)]
    problems += [_outside_text(row) for row in judged if row["status"] == OUTSIDE]
    verdicts = read_verdicts(reference), read_verdicts(run)
    flipped, changed = _changed_verdicts(*verdicts)
    problems += flipped
    remarks += changed
    for path in sorted((reference / "figures").glob("*.png")):
        if not (run / "figures" / path.name).is_file():
            problems.append(f"figures/{path.name}: missing")
    cells = pd.DataFrame(judged, columns=list(JUDGED_COLUMNS))
    settings = differing_settings(known, ours)
    return RunComparison(
        reference, run, cells, settings, tuple(problems), tuple(remarks), len(verdicts[0])
    )


def sigma_ratio(n_folds: int) -> float:
    """Return the factor by which σ of `n_folds` folds may differ, either way.

    The square root of the 97.5 % quantile of the F distribution with ``n_folds - 1`` degrees of
    freedom twice: 3.1 for five folds.
    """
    return math.sqrt(stats.f.ppf(0.975, n_folds - 1, n_folds - 1))


def _unmatched(
    these: Mapping[tuple[str, ...], CellRecord], those: Mapping[tuple[str, ...], CellRecord]
) -> list[str]:
    """Name the rows, methods or single cells that `those` lack."""
    rows, methods = ({key[i] for key in those} for i in (0, 1))
    texts = []
    for key, cell in these.items():
        if key[0] not in rows:
            texts.append(f"row {cell['row_label']}")
        elif key[1] not in methods:
            texts.append(f"method {method_label(key[1])}")
        elif key not in those:
            texts.append(_cell_text(cell))
    return list(dict.fromkeys(texts))


def _differing_counts(pairs: Iterable[tuple[CellRecord, CellRecord]]) -> list[str]:
    """Return a line for each row with different numbers of objects or views."""
    return list(
        dict.fromkeys(
            f"{theirs['table']}, {theirs['row_label']}: {mine[column]:.0f} {label}, "
            f"reference {theirs[column]:.0f}"
            for theirs, mine in pairs
            for column, label in _COUNTS.items()
            if theirs[column] != mine[column]
        )
    )


def judge_cell(theirs: CellRecord, mine: CellRecord, factor: float) -> list[CellRecord]:
    """Judge the figures of a cell: its value, its paired difference, its σ.

    ``theirs`` is the reference's, ``factor`` the `sigma_ratio`. Returns `JUDGED_COLUMNS`, one row
    for each figure that either cell has.
    """
    rows = []
    is_sigma = theirs["row"] == SIGMA_ROW
    # Both σ are judged, so their difference adds nothing.
    for quantity in ("value",) if is_sigma else ("value", "difference", "sigma"):
        reference, here = float(theirs[quantity]), float(mine[quantity])
        rare = theirs["metric"] == ABOVE_90
        if (math.isnan(reference) and math.isnan(here)) or (rare and quantity == "sigma"):
            continue
        low, high = _tolerance("sigma" if is_sigma else quantity, theirs, mine, factor)
        if reference == here:
            status = IDENTICAL
        elif theirs["metric"] in _EXAMPLE_METRICS or (rare and is_sigma):
            status = UNJUDGED
        else:
            status = WITHIN if low <= here <= high else OUTSIDE
        figures = {"reference": reference, "low": low, "high": high, "here": here}
        rows.append(theirs | {"quantity": quantity, "status": status} | figures)
    return rows


def _tolerance(
    quantity: str, theirs: CellRecord, mine: CellRecord, factor: float
) -> tuple[float, float]:
    """Return the bounds for the new figure; see the module's docstring."""
    if quantity == "sigma":
        sigma = theirs["value"] if theirs["row"] == SIGMA_ROW else theirs["sigma"]
        return sigma / factor, sigma * factor
    interval = "ci" if quantity == "value" else quantity
    low, high = theirs[f"{interval}_low"], theirs[f"{interval}_high"]
    # The reach of the new interval to either side, as bounds for its figure.
    below = mine[quantity] - mine[f"{interval}_low"]
    above = mine[f"{interval}_high"] - mine[quantity]
    if not (below >= 0 and above >= 0):
        below = above = 0.0  # no interval, or that of another quantity
    if quantity == "value":
        return min(low, theirs["value"] - above), max(high, theirs["value"] + below)
    return low - above, high + below


def _cell_text(cell: CellRecord) -> str:
    metric = _METRIC_LABELS.get(cell["metric"], cell["metric"])
    return f"{cell['row_label']}, {method_label(cell['method'])}, {metric}"


_QUANTITY_LABELS = {"value": "", "difference": " paired difference", "sigma": " σ over folds"}


def _outside_text(row: CellRecord) -> str:
    return (
        f"{row['table']}, {_cell_text(row)}{_QUANTITY_LABELS[row['quantity']]}: "
        f"{number(row['here'])}, reference {number(row['reference'])} "
        f"(tolerance {number(row['low'])} to {number(row['high'])})"
    )


def _changed_verdicts(
    theirs: Mapping[str, str], mine: Mapping[str, str]
) -> tuple[list[str], list[str]]:
    """Return lines for claims that are missing or reversed, and for other changes."""
    failures, changes = [], []
    for name, verdict in theirs.items():
        here = mine.get(name)
        text = f"claim {name}: {here}, reference {verdict}"
        if here is None:
            failures.append(f"claim {name}: missing")
        elif {here, verdict} == {HOLDS, FAILS}:
            failures.append(text)
        elif here != verdict:
            changes.append(text)
    changes += [f"claim {name}: not in the reference" for name in mine if name not in theirs]
    return failures, changes

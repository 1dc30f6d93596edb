"""The paper's Tables 1 to 7 as printed, from ``published.csv``, with ``published_notes.csv``.

MAE in degrees, pAUC in percent.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

METHODS = ("single", "random", "opposite", "proposed")
"""The paper's methods, in the order of its columns."""

FOCUS_CATEGORY = "mug"
"""The category of Tables 2 and 4 to 7."""

AVERAGE_ROW = "average"
SIGMA_ROW = "sigma"

Values = Mapping[str, Mapping[str, tuple[float, ...]]]
"""The values of a table by metric and row, in the order of `METHODS`."""


@dataclass(frozen=True)
class Note:
    """A remark on some published numbers, shown only with them.

    Empty fields stand for any number. With `ours` it explains our numbers as well, and is shown
    even where none is published.
    """

    text: str
    tables: tuple[str, ...]
    metric: str = ""
    rows: tuple[str, ...] = ()
    method: str = ""
    ours: bool = False


def paper_rows(name: str) -> list[dict[str, Any]]:
    """Return the rows of a CSV file in this module's folder."""
    with Path(__file__).with_name(name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _read_values() -> dict[str, Values]:
    tables: dict[str, dict[str, dict[str, tuple[float, ...]]]] = {}
    for row in paper_rows("published.csv"):
        rows = tables.setdefault(row["table"], {}).setdefault(row["metric"], {})
        rows[row["row"]] = tuple(float(row[method]) for method in METHODS)
    return dict(tables)


def _read_note(row: Mapping[str, str]) -> Note:
    tables, rows = (tuple(row[name].split()) for name in ("tables", "rows"))
    return Note(row["text"], tables, row["metric"], rows, row["method"], row["ours"] == "yes")


PUBLISHED: Mapping[str, Values] = _read_values()
"""The paper's tables by name, ``table1`` to ``table7``."""

NOTES = tuple(map(_read_note, paper_rows("published_notes.csv")))


def published_value(table: str, metric: str, row: str, method: str) -> float:
    """Return one published value as printed, or NaN where the paper prints none.

    The metric is ``mae`` (degrees), ``pauc`` (percent), or ``estimate`` and ``error`` (degrees,
    Table 6), the row a category, elevation, group, initial azimuth or fold, or `AVERAGE_ROW` or
    `SIGMA_ROW`.
    """
    row_values = PUBLISHED[table].get(metric, {}).get(row)
    if row_values is None or method not in METHODS:
        return math.nan
    return row_values[METHODS.index(method)]

"""Printed forms of numbers, intervals, methods and categories."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MINUS = "\u2212"

_METHOD_LABELS: Mapping[str, str] = {
    "single": "Single",
    "random": "Random",
    "opposite": "Opposite",
    "proposed": "Proposed",
}


def method_label(method: str) -> str:
    """Return a method's name for tables and figures."""
    return _METHOD_LABELS.get(method, method.replace("_", " ").capitalize())


def category_label(category: str) -> str:
    """Return a category's name for tables and figures."""
    return category.replace("_", " ").capitalize()


def number(value: float, decimals: int = 2) -> str:
    """Return a number with a true minus sign, or an en dash if it is not finite."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{decimals}f}"
    return text.replace("-", MINUS) if float(text) != 0 else text.lstrip("-")


def interval_text(value: float, low: float, high: float, decimals: int = 2) -> str:
    """Return ``value (low to high)``."""
    ends = f"{number(low, decimals)} to {number(high, decimals)}"
    return f"{number(value, decimals)} ({ends})"


def matrix_lines(matrix: NDArray[np.float64]) -> list[str]:
    """Return the rows of a matrix with five decimals, indented; 0 has no sign."""
    rows = matrix.round(5) + 0.0
    return ["  " + " ".join(f"{value:9.5f}" for value in row) for row in rows]


def duration(seconds: float) -> str:
    """Return a duration such as ``1 h 10 min``, ``3 min 20 s`` or ``48 min``."""
    if seconds >= 3600:
        counts, units = divmod(round(seconds / 60), 60), ("h", "min")
    else:
        counts, units = divmod(round(seconds), 60), ("min", "s")
    parts = [f"{n} {unit}" for n, unit in zip(counts, units, strict=True) if n]
    return " ".join(parts) or f"0 {units[1]}"


def counted(number: int, noun: str) -> str:
    """Return a number and a noun with a regular plural: ``1 view``, ``2 views``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"

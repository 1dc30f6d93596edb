"""A figure: a ratio, what it should be, and how it came about."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Target:
    """A bound on a ratio; `at_most` says from which side."""

    bound: float
    at_most: bool = False

    def holds(self, ratio: float) -> bool:
        """Say whether a ratio lies on the right side of the bound, or on it."""
        return ratio <= self.bound if self.at_most else ratio >= self.bound

    def __str__(self) -> str:
        return f"{'≤' if self.at_most else '≥'} {self.bound:g}"


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes
    ----------
    name : str
    ratio : float or None
        None where it could not be measured; `detail` then says why.
    target : Target
    detail : str
        What was measured, in absolute terms.
    """

    name: str
    ratio: float | None
    target: Target
    detail: str

    @property
    def reached(self) -> bool | None:
        """Whether the target is reached; None without a ratio."""
        return None if self.ratio is None else self.target.holds(self.ratio)

    def as_json(self) -> dict[str, Any]:
        """Return what is kept: numbers for the ratio, text for the target."""
        return {
            "name": self.name,
            "ratio": None if self.ratio is None else round(self.ratio, 4),
            "target": str(self.target),
            "reached": self.reached,
            "detail": self.detail,
        }


_VERDICT = {True: "reached", False: "MISSED", None: ""}
HEADER = f"{'what':44} {'ratio':>8}  {'target':8} {'':8} detail"


def table_line(figure: Figure) -> str:
    ratio = "–" if figure.ratio is None else f"{figure.ratio:.3g}"
    if figure.ratio is not None and abs(figure.ratio) >= 1000:
        ratio = f"{figure.ratio:,.0f}"
    verdict = _VERDICT[figure.reached]
    return f"{figure.name:44} {ratio:>8}  {figure.target!s:8} {verdict:8} {figure.detail}".rstrip()


def summary_line(figures: Iterable[Figure]) -> str:
    verdicts = [figure.reached for figure in figures]
    measured = [verdict for verdict in verdicts if verdict is not None]
    return f"{sum(measured)} of {len(measured)} targets reached"

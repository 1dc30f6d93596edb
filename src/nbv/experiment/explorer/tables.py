"""Lookup tables and images' own distributions, as text for the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.criteria import cost_unit
from nbv.core.estimates import Posteriors
from nbv.core.lookup import LookupTable
from nbv.experiment.explorer.images import (
    Quantised,
    as_text,
    quantised,
    quantised_logs,
    rows_differenced,
)

Table = NDArray[np.float64]


@dataclass(frozen=True)
class PageTable:
    """A lookup table as the page has it.

    Calibration sees every viewpoint alike often, so V[e] is L[., e] made to sum to 1: the page
    keeps L alone.

    Attributes
    ----------
    logs : Quantised
        Of L[viewpoint, estimate].
    cost : Quantised
        A[estimate, delta].
    unit : str
        Of the cost.
    """

    logs: Quantised
    cost: Quantised
    unit: str

    @property
    def estimate_likelihood(self) -> Table:
        """L[viewpoint, estimate]."""
        weights = np.exp(self.logs.restored)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    @property
    def viewpoint_likelihood(self) -> Table:
        """V[estimate, viewpoint]."""
        weights = self.estimate_likelihood.T
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    @property
    def facts(self) -> dict[str, Any]:
        """What the page has to know before it decodes `text`."""
        return {
            "bins": len(self.logs.codes),
            "low": self.logs.low,
            "high": self.logs.high,
            "costLow": self.cost.low,
            "costHigh": self.cost.high,
            "unit": self.unit,
        }

    @property
    def text(self) -> str:
        """Both tables, the codes of L first."""
        return as_text(rows_differenced(self.logs.codes), rows_differenced(self.cost.codes))


def page_table(table: LookupTable) -> PageTable:
    """Return a lookup table as the page has it."""
    return PageTable(
        quantised_logs(table.estimate_likelihood),
        quantised(table.cost),
        cost_unit(table.criterion, {"spread": table.spread}),
    )


def probability_error(stored: PageTable, table: LookupTable) -> float:
    """Return how far the page's probabilities p(viewpoint | estimate) are off, at the most.

    As a part of the largest probability of the same row.
    """
    exact = table.viewpoint_likelihood.astype(np.float64)
    off = np.abs(stored.viewpoint_likelihood - exact)
    return float((off.max(axis=1) / exact.max(axis=1)).max())


def cost_error(stored: PageTable, table: LookupTable) -> float:
    """Return how far the page's costs are off, at the most, in the cost's unit."""
    return float(np.abs(stored.cost.restored - table.cost).max())


def own_distributions_text(posteriors: Posteriors) -> str:
    """Return the distributions of the images of every class's azimuth, as text.

    Square roots in 256 steps, of the largest of each distribution; (n_objects, k, k) bytes.
    """
    return as_text(own_codes(posteriors).tobytes())


def own_codes(posteriors: Posteriors) -> NDArray[np.uint8]:
    """Return the codes (n_objects, k, k) of `own_distributions_text`."""
    rows = posteriors.distributions
    n_views, n_classes = rows.shape[1:]
    shown = rows[:, :: n_views // n_classes]
    roots = np.sqrt(shown / shown.max(axis=-1, keepdims=True))
    return np.asarray(np.rint(255.0 * roots).astype(np.uint8))


def own_error(posteriors: Posteriors) -> float:
    """Return how far they are off, at the most, as a part of each distribution's largest."""
    rows = posteriors.distributions
    shown = rows[:, :: rows.shape[1] // rows.shape[2]]
    kept = own_codes(posteriors).astype(np.float64) ** 2
    kept /= kept.sum(axis=-1, keepdims=True)
    return float((np.abs(kept - shown).max(axis=-1) / shown.max(axis=-1)).max())

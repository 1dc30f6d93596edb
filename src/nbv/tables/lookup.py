"""Lookup tables in files."""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nbv.choice.answers import UNKNOWN_DEG, Answer
from nbv.choice.next_view import Move
from nbv.choice.rotations import GUESS, ranked_rotations
from nbv.core.choose import ANY_VIEW_SHARE
from nbv.core.circle import lookup
from nbv.core.circle.angles import nearest_bin
from nbv.core.circle.criteria import CRITERIA, FOR_A_FUSION, POSE_LIKELIHOODS, SPREADS, cost_unit
from nbv.core.circle.evidence import Evidence
from nbv.core.circle.lookup import LIMITS, CostTable, recommended_delta
from nbv.files import (
    CALIBRATE_AGAIN,
    Arrays,
    check_distributions,
    damaged,
    stored_table,
    write_arrays,
)


@dataclass(frozen=True, kw_only=True)
class CostMove(Move):
    """A rotation with its cost in a lookup table, which is an expected error in some of them."""

    cost: float


@dataclass(frozen=True, kw_only=True)
class CostRecommendation(Answer[CostMove]):
    """The rotations for an estimated azimuth, in [0, 360), best first.

    The criterion says what the cost of a move is. Where costs are errors of calibration objects,
    the expected error is that of one view, else NaN.
    """

    azimuth_deg: float
    criterion: str
    cost_unit: str

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        return [f"azimuth {self.azimuth_deg:.1f}° (camera around {seen}, as estimated)"]

    def value(self, about: CostMove) -> str:
        """Return the cost of a move as text."""
        unit = "" if self.cost_unit == "1" else f" {self.cost_unit}"
        return f"{self.criterion} {about.cost:.3f}{unit}"

    def short_value(self, move: CostMove) -> str:
        """Return the cost of a move as a number."""
        return f"{move.cost:.3f}"


class LookupTable(CostTable):
    """A criterion tabulated for one estimator, which a file can hold.

    Attributes are those of `nbv.core.circle.lookup.CostTable`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> estimates = np.arange(0.0, 360.0, 10.0)[None]  # one object, always right
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> params = {"bandwidth_deg": 8, "pseudo_observations": 3, "n_bins": 36}
    >>> evidence = nbv.gather_evidence(estimates, density, **params)
    >>> table = nbv.build_lookup(evidence, "pose_ambiguity")
    >>> table.criterion, table.cost.shape
    ('pose_ambiguity', (36, 36))
    """

    @classmethod
    def of(cls, table: CostTable) -> LookupTable:
        """Return the same table."""
        return cls(**{item.name: getattr(table, item.name) for item in fields(table)})

    @classmethod
    def load(cls, path: str | Path) -> LookupTable:
        """Read a file of `save`.

        Raises
        ------
        UserError
            If the file cannot be read, or a value is not one that `build_lookup` makes. A file
            without `travel_cost` and `max_travel_deg` has no such limits.
        """
        names = [item.name for item in fields(cls)]
        needed = [name for name in names if name not in LIMITS]
        with stored_table(path, needed, "lookup table") as stored:
            # An array without axes holds a number or a text.
            values: dict[str, Any] = {
                name: stored[name] if stored[name].ndim else stored[name].item()
                for name in names
                if name in stored
            }
            table = cls(**values)
            n_bins = len(table.cost)
            for density in (table.viewpoint_likelihood, table.estimate_likelihood):
                check_distributions(path, density, (n_bins, n_bins), CALIBRATE_AGAIN)
            if problem := table._problem():
                raise damaged(path, problem, CALIBRATE_AGAIN)
        return table

    def rank(
        self,
        estimate_deg: float,
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
    ) -> CostRecommendation:
        """Return the rotations for an estimate by their cost; see `ranked_rotations`."""
        ranked, warnings = ranked_rotations(self, estimate_deg, allowed_deg, max_travel_deg)
        # Other costs are no errors of calibration objects. The same view twice errs as one view.
        share = 1.0 if self.criterion in FOR_A_FUSION else UNKNOWN_DEG
        now_deg = share * float(self.cost[nearest_bin(estimate_deg, len(self.cost)), 0])
        moves = tuple(
            CostMove(
                rotation_deg=rotation,
                travel_deg=abs(rotation),
                expected_error_deg=share * cost,
                cost=cost,
            )
            for rotation, cost in ranked
        )
        is_less = moves[0].cost < ANY_VIEW_SHARE * now_deg
        return CostRecommendation(
            azimuth_deg=estimate_deg % 360.0,
            expected_error_deg=now_deg,
            criterion=self.criterion,
            cost_unit=cost_unit(self.criterion, {"spread": self.spread}),
            moves=moves,
            warnings=warnings,
            helps=None if math.isnan(now_deg) else is_less and GUESS not in warnings,
        )

    def arrays(self) -> Arrays:
        """Return the attributes by name, as arrays."""
        return {item.name: np.asarray(getattr(self, item.name)) for item in fields(self)}

    def save(self, path: str | Path) -> None:
        """Write the attributes as ``.npz``."""
        write_arrays(path, self.arrays())

    def _problem(self) -> str | None:
        """Return what `build_lookup` does not make, or None."""
        known: dict[str, Container[str]]
        known = {"criterion": CRITERIA, "spread": SPREADS, "pose_likelihood": POSE_LIKELIHOODS}
        wrong = [name for name, choices in known.items() if str(getattr(self, name)) not in choices]
        for name in ("bandwidth_deg", "pseudo_observations", *LIMITS):
            value = getattr(self, name)
            if type(value) not in (int, float) or not 0 <= value < math.inf:
                wrong.append(name)
        if wrong:
            return f"{wrong[0]} is {getattr(self, wrong[0])!r}"
        n_bins = len(self.cost)
        if self.cost.dtype.kind != "f" or self.cost.shape != (n_bins, n_bins) or n_bins < 4:
            return f"costs are {self.cost.dtype} of shape {self.cost.shape}"
        unit = cost_unit(self.criterion, {"spread": self.spread})
        # A cost without a unit may be that of a user's criterion.
        most = {"nats": math.log(n_bins), "degrees": 180.0}.get(unit, 1e6)
        least = -most if unit == "1" else 0.0
        # Beyond the rounding of single precision; NaN is wrong too.
        if not ((self.cost > least - 1e-3) & (self.cost < most + 1e-3)).all():
            return f"a cost is not between {least:g} and {most:.4g}"
        best_deg = recommended_delta(self.cost, vars(self))
        is_least = np.array_equal(self.recommended_delta_deg, best_deg)
        return None if is_least else "a recommended rotation is not that of least cost"


def build_lookup(evidence: Evidence, criterion: str, fusion: str = "average") -> LookupTable:
    """Tabulate a criterion and find the rotations of least cost.

    Same parameters and errors as `nbv.core.circle.criteria.tabulate`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> truth = np.arange(360.0)
    >>> estimates = np.where(np.abs(truth - 90) < 60, 90.0, truth)  # blind around 90 degrees
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> evidence = nbv.gather_evidence(
    ...     estimates[None], density, bandwidth_deg=8, pseudo_observations=3
    ... )
    >>> table = nbv.build_lookup(evidence, "pose_ambiguity")
    >>> bool(60 < table.recommend(90.0) < 300)  # it leaves the blind range
    True
    """
    return LookupTable.of(lookup.build_lookup(evidence, criterion, fusion))

"""What a rotation is worth: ambiguity tables A[estimate, delta], lower is better.

Every criterion is ``criterion(evidence, fusion) -> A``, (B, B) float32: `evidence` holds the
calibration estimates and the densities of them, `fusion` names the rule by which the two answers
will be made one. All axis shifts are cyclic: turning the object by k bins rolls the tables by k.
"""

from __future__ import annotations

from collections.abc import Callable

from nbv.errors import UserError, nearest
from nbv.recommendation.criteria.expected_dispersion import expected_dispersion
from nbv.recommendation.criteria.expected_error import expected_error
from nbv.recommendation.criteria.fixed import fixed
from nbv.recommendation.criteria.information_gain import information_gain
from nbv.recommendation.criteria.pose_ambiguity import pose_ambiguity
from nbv.recommendation.evidence import Evidence, Table

Criterion = Callable[[Evidence, str], Table]

CRITERIA: dict[str, Criterion] = {
    "entropy": pose_ambiguity,
    "information_gain": information_gain,
    "expected_dispersion": expected_dispersion,
    "expected_error": expected_error,
    "fixed": fixed,
}

FOR_A_FUSION = frozenset({"expected_error", "fixed"})
"""Criteria whose table depends on the fusion rule; of the others one serves all rules."""


def tabulate(criterion: str, evidence: Evidence, fusion: str) -> Table:
    """Return A[estimate, delta] of a criterion by name, made once for the same evidence.

    Raises
    ------
    UserError
        For an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise UserError(f"criterion {criterion!r} is unknown: {nearest(criterion, CRITERIA)}")
    key = (criterion, fusion if criterion in FOR_A_FUSION else None)
    return evidence.once(key, lambda: CRITERIA[criterion](evidence, fusion))

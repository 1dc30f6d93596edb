"""What the next view costs: criteria A[belief, delta], lower is better.

Every criterion is ``criterion(belief, evidence, fusion) -> A``. A lookup table is the criterion at
the rows of V. All axis shifts are cyclic: turning the object by k bins rolls the rows of a table
by k.

Parameters
----------
belief : Belief
    What is known of n poses, in B bins.
evidence : Evidence
    Of the estimator that takes the next view, B bins.
fusion : str
    The rule that will make one pose of the estimates: a name in
    `nbv.core.fusion.FUSIONS`.

Returns
-------
ndarray (n, B) float32
    A[belief, delta] in the unit of `cost_unit`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nbv.core.belief import Belief, every_belief
from nbv.core.criteria.bayes_error import bayes_error
from nbv.core.criteria.expected_dispersion import expected_dispersion
from nbv.core.criteria.expected_error import expected_error
from nbv.core.criteria.fixed import fixed
from nbv.core.criteria.information_gain import information_gain
from nbv.core.criteria.pose_ambiguity import pose_ambiguity
from nbv.core.evidence import Evidence, Table
from nbv.errors import UserError, nearest

Criterion = Callable[[Belief, Evidence, str], Table]

CRITERIA: dict[str, Criterion] = {
    "pose_ambiguity": pose_ambiguity,
    "information_gain": information_gain,
    "expected_dispersion": expected_dispersion,
    "bayes_error": bayes_error,
    "expected_error": expected_error,
    "fixed": fixed,
}

FOR_A_FUSION = frozenset({"expected_error", "fixed"})
"""Criteria that depend on the fusion rule and are of one estimator; the others serve all rules."""

OF_ERRORS = frozenset({"bayes_error", *FOR_A_FUSION})
"""Criteria in degrees."""

FOR_ESTIMATES = frozenset({"bayes_error"})
"""Criteria that need calibration estimates and are not defined for distributions of images."""

FOR_MORE_VIEWS = ("information_gain", "expected_dispersion", "bayes_error")
"""Criteria that are defined after any number of views."""

FOR_TWO_ESTIMATORS = ("pose_ambiguity", *FOR_MORE_VIEWS)
"""Criteria that are defined where another estimator takes the next view."""


def cost_unit(criterion: str, settings: Mapping[str, Any]) -> str:
    """Return the unit of a criterion's cost: ``nats``, ``degrees`` or ``1``.

    The pose ambiguity's depends on the ``spread`` in the configuration's ``density``.
    """
    if criterion in OF_ERRORS:
        return "degrees"
    of_entropy = criterion == "pose_ambiguity" and settings["spread"] == "entropy"
    return "nats" if of_entropy or criterion == "information_gain" else "1"


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
    return evidence.once(key, lambda: CRITERIA[criterion](every_belief(evidence), evidence, fusion))

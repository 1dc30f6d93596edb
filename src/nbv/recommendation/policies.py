"""Choosing the next view: the baselines, and the one way to ask either them or a criterion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError, nearest
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.fusion import FUSIONS, Rotations, rotation_errors_deg
from nbv.recommendation.lookup import build_lookup, least_ambiguous_delta

Angles = NDArray[np.float64]

SINGLE = "none"
ORACLE = "oracle"


def _random(estimate_deg: Angles, rng: np.random.Generator) -> Rotations:
    """Return a view other than the first, all equally likely."""
    n_views = estimate_deg.shape[1]
    return np.asarray(rng.integers(1, n_views, estimate_deg.shape) * (360 // n_views))


def _opposite(estimate_deg: Angles, rng: np.random.Generator) -> Rotations:
    return np.full(estimate_deg.shape, 180, dtype=np.int64)


BASELINES: dict[str, Callable[[Angles, np.random.Generator], Rotations]] = {
    "random": _random,
    "opposite": _opposite,
}


def needs_lookup(rotation: str) -> bool:
    """Say whether a method's ``rotation`` is recommended by a lookup table.

    Raises
    ------
    UserError
        Where it is neither a baseline nor a criterion.
    """
    if rotation in (SINGLE, ORACLE) or rotation in BASELINES:
        return False
    if rotation in CRITERIA:
        return True
    known = [SINGLE, *BASELINES, *CRITERIA, ORACLE]
    raise UserError(f"methods: rotation {rotation!r} is unknown: {nearest(rotation, known)}")


def check_names(key: str, method: Mapping[str, Any]) -> None:
    """Raise UserError where the rotation or the fusion that stands at `key` is unknown."""
    needs_lookup(method["rotation"])
    if method["fusion"] not in FUSIONS:
        given = f"{key}.fusion={method['fusion']}"
        raise UserError(f"{given} is unknown: {nearest(method['fusion'], FUSIONS)}")


def oracle(estimate_deg: Angles, evidence: Evidence, fusion: str) -> Rotations:
    """Return the rotation of least error from each view, as only the truth can tell.

    The bound of all methods that fuse alike, and no competitor. Of equals the smallest travel.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n.
    evidence, fusion
        See `nbv.recommendation.fusion.rotation_errors_deg`.
    """
    errors = rotation_errors_deg(estimate_deg, evidence, fusion)
    by_view = errors.reshape(len(errors), -1).T
    return least_ambiguous_delta(by_view).reshape(estimate_deg.shape)


def rotate(
    rotation: str,
    fusion: str,
    estimate_deg: Angles,
    evidence: Evidence,
    rng: np.random.Generator,
) -> Rotations:
    """Return the rotation that is taken from each view.

    Parameters
    ----------
    rotation : str
        A name in `BASELINES`, in `nbv.recommendation.criteria.CRITERIA`, or `ORACLE`.
    fusion : str
        A name in `nbv.recommendation.fusion.FUSIONS`.
    estimate_deg : ndarray (n_objects, n_views)
        First estimates; view k of n has the azimuth 360 k / n.
    evidence : Evidence
        Of other objects.
    rng : numpy.random.Generator
        Where the rotation is drawn.

    Returns
    -------
    ndarray (n_objects, n_views) int64, degrees in [0, 360)
    """
    if rotation in BASELINES:
        return BASELINES[rotation](estimate_deg, rng)
    if rotation == ORACLE:
        return oracle(estimate_deg, evidence, fusion)
    return build_lookup(evidence, rotation, fusion).recommend(estimate_deg)

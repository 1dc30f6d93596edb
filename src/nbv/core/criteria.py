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

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import direction_deg, nearest_bin
from nbv.core.belief import Belief, every_belief
from nbv.core.density import Conditionals, von_mises_kernel
from nbv.core.evidence import Evidence, Table
from nbv.core.fusion import OF_DISTRIBUTIONS, calibration_errors_deg
from nbv.errors import UserError, nearest

Criterion = Callable[[Belief, Evidence, str], Table]


Spread = Callable[[Table], NDArray[np.float32]]


def entropy(distributions: Table) -> NDArray[np.float32]:
    """Return the entropy of each row in nats, 0 log 0 being 0 (Eq. 1)."""
    tiny = np.finfo(np.float32).tiny
    logs = np.log(np.maximum(distributions, tiny))
    return np.asarray(-np.einsum("ij,ij->i", distributions, logs), dtype=np.float32)


def circular_variance(distributions: Table) -> NDArray[np.float32]:
    """Return 1 - abs(mean direction) of each row, in [0, 1]."""
    angles = 2 * np.pi * np.arange(distributions.shape[1]) / distributions.shape[1]
    cosine = distributions @ np.cos(angles).astype(np.float32)
    sine = distributions @ np.sin(angles).astype(np.float32)
    return np.asarray(1.0 - np.hypot(cosine, sine), dtype=np.float32)


SPREADS: dict[str, Spread] = {"entropy": entropy, "circular_variance": circular_variance}


# Numbers in the largest array that a criterion makes of a group of rotations.
_CHUNK = 2**16


def rotation_groups(n_bins: int, numbers_each: int) -> Iterator[range]:
    """Yield all rotations 0 to n_bins - 1, as many at once as a criterion has cache for.

    One rotation needs an array of `numbers_each` numbers. Few beliefs take many rotations at once
    and many beliefs few: no call of numpy is small.
    """
    at_once = max(1, _CHUNK // max(1, numbers_each))
    for start in range(0, n_bins, at_once):
        yield range(start, min(start + at_once, n_bins))


POSE_LIKELIHOODS = ("given_estimate", "given_truth")


def pose_likelihood(conditionals: Conditionals, name: str) -> Table:
    """Return T[viewpoint, pose] = p(pose | viewpoint) under one of its two interpretations.

    ``given_estimate``: how spread the truth is when the viewpoint is the estimate (T = V).
    ``given_truth``: how spread the estimates are when the viewpoint is the truth (T = L).
    """
    if name not in POSE_LIKELIHOODS:
        raise UserError(f"density.pose_likelihood={name}: {nearest(name, POSE_LIKELIHOODS)}")
    of_name = conditionals.viewpoint if name == "given_estimate" else conditionals.estimate
    return of_name.astype(np.float32)


def two_view_poses(viewpoint: Table, pose: Table, delta_bins: int) -> Table:
    """Return p(theta | estimate, delta) for one rotation (Eqs. 3 and 6).

    Parameters
    ----------
    viewpoint : ndarray (n, B) float32
        V[estimate, viewpoint].
    pose : ndarray (B, B) float32
        T[viewpoint, pose] of the estimator that takes both views.
    delta_bins : int
        The rotation, in bins.

    Returns
    -------
    ndarray (n, B) float32
        Rows are distributions. Two estimates that exclude each other say nothing about the pose.
    """
    return _mixed(viewpoint, pose, np.roll(pose, (-delta_bins, -delta_bins), axis=(0, 1)))


def _mixed(viewpoint: Table, first: Table, second: Table) -> Table:
    """Return Eq. 6 of both factors in the frame of the first view, mixed by Eq. 3."""
    product = first * second
    total = product.sum(axis=1)
    impossible = total <= 0
    if impossible.any():
        product[impossible] = 1.0 / len(product)
        total[impossible] = 1.0
    return np.asarray((viewpoint / total) @ product)


def pose_ambiguity(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the paper's ambiguity of the pose seen from two viewpoints (Eqs. 1 to 6).

    With T of the estimator that took the first view, T' of the one that takes the second, and the
    belief b (V[e] for an estimate e) ::

        p(theta | phi, delta) = T[phi, theta] T'[phi + delta, theta + delta] / Z(phi, delta)
        p(theta | b, delta)   = sum_phi b(phi) p(theta | phi, delta)
        A[b, delta]           = G(p(. | b, delta))

    Parameters as of the module; `fusion` is not used. The evidence's settings
    are ``pose_likelihood`` (see `pose_likelihood`) and ``spread``, the name of G: ``entropy``
    (nats) or ``circular_variance`` (0 to 1).

    Raises
    ------
    ValueError
        After more than one view: Eq. 6 has one factor for each of two views.
    """
    if belief.n_views != 1:
        raise ValueError(f"pose_ambiguity is defined for two views, not {belief.n_views + 1}")
    name, of_what = evidence.settings["spread"], evidence.settings["pose_likelihood"]
    spread = SPREADS.get(name)
    if spread is None:
        raise UserError(f"density.spread={name}: {nearest(name, SPREADS)}")
    rows, n_bins = belief.probabilities, evidence.n_bins
    first = pose_likelihood(belief.evidence.conditionals, of_what)
    second = pose_likelihood(evidence.conditionals, of_what)
    # Twice over, every rotation is a view of it; unlike np.tile this keeps the order in memory.
    twice = np.concatenate([np.concatenate([second, second])] * 2, axis=1)
    ambiguity = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        poses = [_mixed(rows, first, twice[d : d + n_bins, d : d + n_bins]) for d in deltas]
        spreads = spread(np.concatenate(poses)).reshape(len(deltas), len(rows))
        ambiguity[:, deltas.start : deltas.stop] = spreads.T
    return ambiguity


def information_gain(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the expected entropy of the pose's posterior (docs/method.md).

    The pose theta is distributed as the belief b (V[e] after one view), the next estimate as
    L[theta + delta]. The chain rule of entropy gives exactly ::

        A[b, delta] = H(b) + sum_theta b(theta) H(L[theta + delta])
                      - H(sum_theta b(theta) L[theta + delta, .])

    so that no posterior has to be formed.

    Parameters as of the module; `fusion` is not used. A is in nats.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    prior = entropy(rows)
    noise = evidence.once("entropy of L", lambda: entropy(evidence.second))
    left = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        predicted = evidence.predicted(rows, deltas)
        known = entropy(predicted.reshape(-1, n_bins)).reshape(len(deltas), len(rows))
        for place, delta in enumerate(deltas):
            left[:, delta] = prior + rows @ noise[delta : delta + n_bins] - known[place]
    return left


def expected_dispersion(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the Bayes risk of the posterior mean direction (docs/method.md).

    Under the loss 1 - cos(error), with the belief b (V[e] after one view)::

        A[b, delta] = 1 - sum_e |sum_theta b(theta) L[theta + delta, e] exp(i theta)|

    Parameters as of the module; `fusion` is not used. A is in [0, 1].
    """
    rows = belief.probabilities
    risk = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(evidence.n_bins, 2 * rows.size):
        if rows is evidence.viewpoint:
            moments = evidence.moments[deltas.start : deltas.stop]
        else:
            moments = evidence.first_moments(rows, deltas)
        length = np.sqrt(moments[:, 0] ** 2 + moments[:, 1] ** 2).sum(axis=-1)
        risk[:, deltas.start : deltas.stop] = (1.0 - length).T
    return risk


# Of the calibration views, in bins; neighbouring views tell much the same.
_STRIDE = 2


def bayes_error(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the expected error of the posterior mean direction after each rotation.

    The pose is distributed as the belief b, and the next estimates are those that calibration
    objects o really gave, at every second bin ::

        A[b, delta] = sum_theta b(theta) mean_o d(m(b, delta, e(o, theta + delta)), theta)

    with m the direction of sum_theta b(theta) L[theta + delta, e] exp(i theta). Unlike
    `expected_error` it takes views of one object as independent given the pose, and is defined
    after any number of views.

    Parameters as of the module; `fusion` is not used. A is in degrees.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    n_objects, n_views = evidence.estimate_deg.shape
    if not n_objects:
        raise ValueError("bayes_error needs calibration estimates")
    given = nearest_bin(evidence.estimate_deg[:, :: n_views // n_bins], n_bins)
    pose = np.arange(0, n_bins, _STRIDE)
    pose_deg = (pose * (360.0 / n_bins)).astype(np.float32)
    weights = rows[:, pose] / (n_objects * rows[:, pose].sum(axis=1, keepdims=True))
    expected = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, len(rows) * n_objects * len(pose)):
        moments = evidence.first_moments(rows, deltas)
        fused = direction_deg(moments[:, 0], moments[:, 1]).astype(np.float32)
        # By rotation, estimate and belief: what is gathered below lies together.
        fused = np.ascontiguousarray(fused.transpose(0, 2, 1))
        place = np.arange(len(deltas))[:, None]
        seen = given[:, (pose + deltas.start + place) % n_bins]
        apart = np.abs(fused[place, seen] - pose_deg[:, None])
        # Both lie in [0, 360), where this is the circular distance.
        error = np.minimum(apart, 360.0 - apart).sum(axis=0)
        expected[:, deltas.start : deltas.stop] = (error * weights.T).sum(axis=1).T
    return expected


BELIEFS_AT_ONCE = 1024
"""How many beliefs are weighed at once, to bound the memory."""


def kernel_weights(evidence: Evidence) -> NDArray[np.float64]:
    """Return how much a calibration view at each bin counts for each estimate, (B, n_objects B).

    A von Mises kernel of the density's bandwidth in the distance of the view's estimate, times
    the number of views that the one stands for.
    """
    n_bins = evidence.n_bins
    step = evidence.n_views // n_bins
    kernel = step * von_mises_kernel(n_bins, evidence.bandwidth_deg)
    bins = nearest_bin(evidence.estimate_deg[:, ::step].ravel(), n_bins)
    return np.asarray(kernel[(np.arange(n_bins)[:, None] - bins) % n_bins])


def affinity(one: Table, other: Table) -> Table:
    """Return the affinity of every pair of distributions (n, B) and (m, B), (n, m) in [0, 1].

    ``sum_theta sqrt(b(theta) c(theta))``, the Bhattacharyya coefficient: 1 where the two are
    equal, 0 where one excludes the other (Bhattacharyya, 1943).
    """
    return np.asarray(np.sqrt(one) @ np.sqrt(other).T)


def view_weights(beliefs: Table, views: Table, power: float) -> Table:
    """Return how much each view (m, B) counts for each belief (n, B), (n, m).

    It is the affinity to the power, times the degrees of a bin: pseudo-observations are views that
    are a degree apart, and `views` are a bin apart.
    """
    return np.asarray(360.0 / views.shape[1] * affinity(beliefs, views) ** power)


def check_first_view(belief: Belief, evidence: Evidence) -> None:
    """Raise ValueError unless the belief is of one view by the estimator of the evidence.

    Of other beliefs nothing is known about the error of two views.
    """
    if belief.n_views != 1 or belief.evidence is not evidence:
        raise ValueError("errors of two views need one first view by the same estimator")


def expected_error(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return a kernel regression of the error on the first view, for each rotation.

    For each calibration object o and view phi (one for each bin) the error of the rotation delta is
    ``l(o, phi, delta) = d(fuse(x(o, phi), x(o, phi + delta), delta), phi)``, where x is what the
    fusion rule fuses. Views count by their likeness with the first view: estimates by a von Mises
    kernel of the density's bandwidth in their distance, distributions by their `affinity` to the
    power ``affinity.power``. Pseudo-observations shrink the mean towards that over all views, so
    that where little is known the best fixed rotation is taken. Nothing is assumed about the
    independence of views of one object (docs/method.md).

    Parameters as of the module; `belief` is of one view by the estimator of
    `evidence`, or ValueError is raised. A is in degrees.
    """
    check_first_view(belief, evidence)
    if fusion in OF_DISTRIBUTIONS:
        return _regression_on_distributions(belief, evidence, fusion)
    if belief.first_bin is None:
        raise ValueError(f"fusion {fusion!r} needs a first estimate")
    table = evidence.once(("regression", fusion), lambda: _regression(evidence, fusion))
    return table[belief.first_bin]


def _regression(evidence: Evidence, fusion: str) -> Table:
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    # A row of 360 is what pseudo-observations are counted in, as in the densities.
    alpha = evidence.pseudo_observations * 360.0 / n_bins
    return _shrunk(kernel_weights(evidence), errors, alpha)


def _regression_on_distributions(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    views, settings = evidence.distributions, evidence.settings["affinity"]
    if views is None:
        raise ValueError(f"fusion {fusion!r} needs evidence of distributions")
    step = evidence.n_views // n_bins
    calibration = views[:, ::step].reshape(-1, n_bins)
    rows = belief.probabilities
    costs = [
        _shrunk(
            view_weights(rows[start : start + BELIEFS_AT_ONCE], calibration, settings["power"]),
            errors,
            settings["pseudo_observations"],
        )
        for start in range(0, len(rows), BELIEFS_AT_ONCE)
    ]
    return np.concatenate(costs)


def _shrunk(weights: NDArray[np.floating[Any]], errors: Table, alpha: float) -> Table:
    """Return the weighted mean error of each rotation (n, B), shrunk by alpha pseudo-observations.

    `weights` are (n, n_views), `errors` (B, n_views).
    """
    alpha = max(alpha, np.finfo(float).tiny)
    total = weights.astype(np.float32) @ errors.T + np.float32(alpha) * errors.mean(axis=1)
    of_all = weights.sum(axis=1, dtype=np.float64) + alpha
    return np.asarray(total / of_all[:, None], dtype=np.float32)


def fixed(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the mean error of each rotation over all calibration views, the same in every row.

    What `expected_error` tends to with ever more
    pseudo-observations; parameters, errors and unit as there.
    """
    check_first_view(belief, evidence)
    errors = calibration_errors_deg(evidence, fusion)
    mean = errors.reshape(evidence.n_bins, -1).mean(axis=1)
    return np.tile(mean, (len(belief.probabilities), 1)).astype(np.float32)


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

"""Criteria: the cost A[belief, delta] of the next view, lower is better.

Every criterion is ``criterion(belief, evidence, fusion) -> A``. A lookup table is the criterion at
the rows of V. All shifts of axes are cyclic: a rotation of the object by k bins rolls the rows of a
table by k.

Parameters
----------
belief : Belief
    Beliefs about n poses, in B bins.
evidence : Evidence
    The estimator that takes the next view, B bins.
fusion : str
    The rule that will fuse the estimates: a name in `nbv.core.circle.fusion.FUSIONS`.

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

from nbv.core.choose import entropy, expected_entropy, mixed, named, with_pseudo_observations
from nbv.core.circle.angles import direction_deg, nearest_bin
from nbv.core.circle.belief import Belief, every_belief
from nbv.core.circle.density import Conditionals, von_mises_kernel
from nbv.core.circle.evidence import Evidence, Float32Array
from nbv.core.circle.fusion import OF_DISTRIBUTIONS, calibration_errors_deg

Criterion = Callable[[Belief, Evidence, str], Float32Array]
Spread = Callable[[Float32Array], Float32Array]


def circular_variance(distributions: Float32Array) -> Float32Array:
    """Return 1 - (resultant length) of each row, in [0, 1]."""
    angles = 2 * np.pi * np.arange(distributions.shape[1]) / distributions.shape[1]
    cosine = distributions @ np.cos(angles).astype(np.float32)
    sine = distributions @ np.sin(angles).astype(np.float32)
    return np.asarray(1.0 - np.hypot(cosine, sine))


SPREADS: dict[str, Spread] = {"entropy": entropy, "circular_variance": circular_variance}

# Numbers in the largest array for a group of rotations, to stay within the processor's cache.
_NUMBERS_AT_ONCE = 2**16


def rotation_groups(n_bins: int, numbers_each: int) -> Iterator[range]:
    """Yield the rotations 0 to n_bins - 1 in groups that fit the processor's cache.

    A rotation needs an array of `numbers_each` numbers.
    """
    at_once = max(1, _NUMBERS_AT_ONCE // max(1, numbers_each))
    for start in range(0, n_bins, at_once):
        yield range(start, min(start + at_once, n_bins))


POSE_LIKELIHOODS: dict[str, Callable[[Conditionals], NDArray[np.floating[Any]]]] = {
    "given_estimate": lambda pair: pair.viewpoint,
    "given_truth": lambda pair: pair.estimate,
    "through_estimate": lambda pair: pair.estimate @ pair.viewpoint,
}


def pose_likelihood(conditionals: Conditionals, name: str) -> Float32Array:
    """Return T[viewpoint, pose] = p(pose | viewpoint) in one of its three interpretations.

    ``given_estimate``: the spread of the truth if the viewpoint is the estimate (T = V).
    ``given_truth``: the spread of the estimates if the viewpoint is the truth (T = L).
    ``through_estimate``: the belief about the pose that a true viewpoint leads to, through the
    estimates of it: T = L V, sum_e p(e | viewpoint) p(pose | e).
    """
    return named("pose likelihood", name, POSE_LIKELIHOODS)(conditionals).astype(np.float32)


def two_view_poses(viewpoint: Float32Array, pose: Float32Array, delta_bins: int) -> Float32Array:
    """Return p(theta | estimate, delta) for one rotation in bins (Eqs. 3 and 6), (n, B).

    It is a mixture by V[estimate, viewpoint] (n, B) of products of T[viewpoint, pose] (B, B), that
    of the estimator that takes both views. A product of factors that exclude each other is uniform.
    """
    return mixed(viewpoint, pose, np.roll(pose, (-delta_bins, -delta_bins), axis=(0, 1)))


def pose_ambiguity(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return the paper's ambiguity of the pose after two views (Eqs. 1 to 6).

    With T of the estimator that took the first view, T' of the estimator that takes the second, and
    the belief b (V[e] for an estimate e) ::

        p(theta | phi, delta) = T[phi, theta] T'[phi + delta, theta + delta] / Z(phi, delta)
        p(theta | b, delta)   = sum_phi b(phi) p(theta | phi, delta)
        A[b, delta]           = G(p(. | b, delta))

    `fusion` is not used. The evidence's settings are ``pose_likelihood`` (see `pose_likelihood`)
    and ``spread``, the name of G: ``entropy`` (nats) or ``circular_variance`` (0 to 1).

    Raises
    ------
    ValueError
        If the belief is after more than one view: Eq. 6 has one factor for each of two views.
    """
    if belief.n_views != 1:
        raise ValueError(f"pose_ambiguity is defined for two views, not {belief.n_views + 1}")
    interpretation = evidence.settings["pose_likelihood"]
    spread = named("spread", evidence.settings["spread"], SPREADS)
    rows, n_bins = belief.probabilities, evidence.n_bins
    first = pose_likelihood(belief.evidence.conditionals, interpretation)
    second = pose_likelihood(evidence.conditionals, interpretation)
    # Tiled, so that every rotation is a view of it; np.tile would change the order in memory.
    twice = np.concatenate([np.concatenate([second, second])] * 2, axis=1)
    ambiguity = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        poses = [mixed(rows, first, twice[d : d + n_bins, d : d + n_bins]) for d in deltas]
        spreads = spread(np.concatenate(poses)).reshape(len(deltas), len(rows))
        ambiguity[:, deltas.start : deltas.stop] = spreads.T
    return ambiguity


def information_gain(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return the expected entropy of the pose's posterior (docs/method.md).

    The pose theta follows the belief b (V[e] after one view), the next estimate L[theta + delta].
    The chain rule of entropy gives exactly ::

        A[b, delta] = H(b) + sum_theta b(theta) H(L[theta + delta])
                      - H(sum_theta b(theta) L[theta + delta, .])

    so that no posterior has to be computed. `fusion` is not used. A is in nats.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    prior = entropy(rows)
    noise_of = evidence.once("entropy of L", lambda: entropy(evidence.second))
    cost = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        predicted = evidence.predicted(rows, deltas)
        for i, delta in enumerate(deltas):
            noise = rows @ noise_of[delta : delta + n_bins]
            cost[:, delta] = expected_entropy(prior, noise, predicted[i])
    return cost


def expected_dispersion(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return the Bayes risk of the posterior mean direction (docs/method.md).

    Under the loss 1 - cos(error), with the belief b (V[e] after one view)::

        A[b, delta] = 1 - sum_e |sum_theta b(theta) L[theta + delta, e] exp(i theta)|

    `fusion` is not used. A is in [0, 1].
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


# Calibration views are used at every second bin: neighbouring views are similar.
_STRIDE = 2


def bayes_error(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return the expected error of the posterior mean direction after each rotation.

    The pose follows the belief b, and the next estimates are those of calibration objects o at
    every second bin ::

        A[b, delta] = sum_theta b(theta) mean_o d(m(b, delta, e(o, theta + delta)), theta)

    with m the direction of sum_theta b(theta) L[theta + delta, e] exp(i theta). Unlike
    `expected_error` it assumes that views of an object are independent given the pose, and is
    defined after any number of views. `fusion` is not used. A is in degrees.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    n_objects, n_views = evidence.estimate_deg.shape
    if not n_objects:
        raise ValueError("bayes_error needs calibration estimates")
    estimates = nearest_bin(evidence.estimate_deg[:, :: n_views // n_bins], n_bins)
    pose = np.arange(0, n_bins, _STRIDE)
    pose_deg = (pose * (360.0 / n_bins)).astype(np.float32)
    weights = rows[:, pose] / (n_objects * rows[:, pose].sum(axis=1, keepdims=True))
    expected = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, len(rows) * n_objects * len(pose)):
        moments = evidence.first_moments(rows, deltas)
        fused = direction_deg(moments[:, 0], moments[:, 1]).astype(np.float32)
        # By rotation, estimate and belief, so that the values gathered below are contiguous.
        fused = np.ascontiguousarray(fused.transpose(0, 2, 1))
        i = np.arange(len(deltas))[:, None]
        second = estimates[:, (pose + deltas.start + i) % n_bins]
        difference = np.abs(fused[i, second] - pose_deg[:, None])
        # The circular distance of angles in [0, 360).
        error = np.minimum(difference, 360.0 - difference).sum(axis=0)
        expected[:, deltas.start : deltas.stop] = (error * weights.T).sum(axis=1).T
    return expected


BELIEFS_AT_ONCE = 1024
"""Beliefs compared with calibration views at once, to bound the memory."""


def kernel_weights(evidence: Evidence) -> NDArray[np.float64]:
    """Return the weight of the calibration view at each bin for each estimate, (B, n_objects B).

    It is a von Mises kernel of the density's bandwidth in the distance of the view's estimate,
    times the number of views per bin.
    """
    n_bins = evidence.n_bins
    step = evidence.n_views // n_bins
    kernel = step * von_mises_kernel(n_bins, evidence.bandwidth_deg)
    bins = nearest_bin(evidence.estimate_deg[:, ::step].ravel(), n_bins)
    return np.asarray(kernel[(np.arange(n_bins)[:, None] - bins) % n_bins])


def affinity(first: Float32Array, second: Float32Array) -> Float32Array:
    """Return the affinity of every pair of distributions (n, B) and (m, B), (n, m) in [0, 1].

    It is ``sum_theta sqrt(b(theta) c(theta))``, the Bhattacharyya coefficient: 1 if the two are
    equal, 0 if they exclude each other (Bhattacharyya, 1943).
    """
    return np.asarray(np.sqrt(first) @ np.sqrt(second).T)


def view_weights(beliefs: Float32Array, views: Float32Array, power: float) -> Float32Array:
    """Return the weight of each view (m, B) for each belief (n, B), (n, m).

    It is the affinity to the power, times the width of a bin in degrees: pseudo-observations count
    views that are a degree apart, and `views` are a bin apart.
    """
    return np.asarray(360.0 / views.shape[1] * affinity(beliefs, views) ** power)


def check_first_view(belief: Belief, evidence: Evidence) -> None:
    """Raise ValueError unless the belief is after one view by the estimator of the evidence."""
    if belief.n_views != 1 or belief.evidence is not evidence:
        raise ValueError("errors of two views need one first view by the same estimator")


def expected_error(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return a kernel regression of the error on the first view, for each rotation.

    For each calibration object o and view phi (one for each bin) the error of the rotation delta is
    ``l(o, phi, delta) = d(fuse(x(o, phi), x(o, phi + delta), delta), phi)``, where x is the
    estimate or the distribution that the rule fuses. Calibration views are weighted by their
    similarity to the first view: estimates by a von Mises kernel of the density's bandwidth in
    their distance, distributions by their `affinity` to the power ``affinity.power``.
    Pseudo-observations shrink the mean towards the mean over all views, which favours the best
    fixed rotation if there is little data. Views of an object need not be independent
    (docs/method.md). A is in degrees.

    Raises
    ------
    ValueError
        If the belief is not after one view by the estimator of `evidence`.
    """
    check_first_view(belief, evidence)
    if fusion in OF_DISTRIBUTIONS:
        return _regression_on_distributions(belief, evidence, fusion)
    if belief.first_bin is None:
        raise ValueError(f"fusion {fusion!r} needs a first estimate")
    # Pseudo-observations are per row of 360, as in the densities.
    alpha = evidence.pseudo_observations * 360.0 / evidence.n_bins
    table = evidence.once(
        ("regression", fusion),
        lambda: _regression(evidence, fusion, kernel_weights(evidence), alpha),
    )
    return table[belief.first_bin]


def _regression_on_distributions(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    views, n_bins = evidence.distributions, evidence.n_bins
    if views is None:
        raise ValueError(f"fusion {fusion!r} needs evidence of distributions")
    calibration = views[:, :: evidence.n_views // n_bins].reshape(-1, n_bins)
    rows, settings = belief.probabilities, evidence.settings["affinity"]
    costs = [
        _regression(
            evidence,
            fusion,
            view_weights(rows[start : start + BELIEFS_AT_ONCE], calibration, settings["power"]),
            settings["pseudo_observations"],
        )
        for start in range(0, len(rows), BELIEFS_AT_ONCE)
    ]
    return np.concatenate(costs)


def _regression(
    evidence: Evidence, fusion: str, weights: NDArray[np.floating[Any]], alpha: float
) -> Float32Array:
    """Return the mean error of each rotation by weights of views (n, n_objects B), (n, B)."""
    errors = calibration_errors_deg(evidence, fusion).reshape(evidence.n_bins, -1)
    sums = weights.astype(np.float32) @ errors.T
    total = with_pseudo_observations(sums, errors.mean(axis=1), alpha)
    weight = with_pseudo_observations(weights.sum(axis=1, dtype=np.float64), 1.0, alpha)
    return np.asarray(total / weight[:, None], dtype=np.float32)


def fixed(belief: Belief, evidence: Evidence, fusion: str) -> Float32Array:
    """Return the mean error of each rotation over all calibration views, the same in every row.

    It is the limit of `expected_error` for many pseudo-observations, with the same errors and unit.
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
"""Criteria that depend on the fusion rule and on a single estimator."""

IN_DEGREES = frozenset({"bayes_error", *FOR_A_FUSION})
"""Criteria in degrees."""

FOR_ESTIMATES = frozenset({"bayes_error"})
"""Criteria that need calibration estimates, and do not support distributions."""


def cost_unit(criterion: str, settings: Mapping[str, Any]) -> str:
    """Return the unit of a criterion's cost: ``nats``, ``degrees`` or ``1``.

    The unit of the pose ambiguity depends on ``spread`` in the configuration's ``density``.
    """
    if criterion in IN_DEGREES:
        return "degrees"
    is_entropy = criterion == "pose_ambiguity" and settings["spread"] == "entropy"
    return "nats" if is_entropy or criterion == "information_gain" else "1"


def tabulate(criterion: str, evidence: Evidence, fusion: str) -> Float32Array:
    """Return A[estimate, delta] of a criterion by name, computed once for the same evidence.

    Raises
    ------
    UserError
        For an unknown criterion.
    """
    made = named("criterion", criterion, CRITERIA)
    key = (criterion, fusion if criterion in FOR_A_FUSION else None)
    return evidence.once(key, lambda: made(every_belief(evidence), evidence, fusion))

"""The mirror plane of a category: mugs, cars and chairs are nearly their own mirror images.

Take objects with a vertical plane of symmetry at the azimuth m. What a camera sees of them from the
azimuth a is the mirror image of what it sees from 2 m - a. A trained network does not know this
exactly. The mean of its logits for an image and for the mirror image, read backwards, does: that is
what `nbv.experiment.estimation.make_bundle.onnx_model` writes where there is a plane.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from nbv.core.logits import fit_temperature, mean_log_likelihood
from nbv.robot.network import Network
from nbv.robot.sweeps import Turn


def mirrored_classes(n_classes: int, plane_deg: float) -> NDArray[np.intp]:
    """Return which class of a mirror image each class (n_classes,) is; twice the plane is a class.

    Examples
    --------
    >>> mirrored_classes(4, 90.0).tolist()
    [2, 1, 0, 3]
    """
    return (round(2 * plane_deg * n_classes / 360) - np.arange(n_classes)) % n_classes


def find_mirror_plane(network: Network, turns: Sequence[Turn]) -> float | None:
    """Return the azimuth of the plane whose averaged network makes the truth likeliest.

    Parameters
    ----------
    network : callable
    turns : sequence of Turn
        Of calibration objects, which the network has not seen, with its own logits. A view every
        15 degrees is enough: neighbouring views say the same.

    Returns
    -------
    float or None
        Degrees in [0, 180), half a class apart; None where the network itself is better than its
        average with any mirror image. Both are compared at their best temperatures.
    """
    azimuth_deg = np.concatenate([turn.azimuth_deg for turn in turns])
    own = np.concatenate([turn.logits for turn in turns]).astype(np.float64)
    mirrored = np.concatenate([network(turn.codes[:, :, ::-1]) for turn in turns])
    n_classes = own.shape[1]
    planes = np.arange(n_classes) * (180.0 / n_classes)

    def averaged(plane_deg: float) -> NDArray[np.float64]:
        return np.asarray((own + mirrored[:, mirrored_classes(n_classes, plane_deg)]) / 2)

    def likelihood(logits: NDArray[np.float64], temperature: float) -> float:
        return mean_log_likelihood(logits, azimuth_deg, temperature)

    of_own = fit_temperature(own, azimuth_deg)
    best = max(planes, key=lambda plane: likelihood(averaged(plane), of_own))
    of_best = fit_temperature(averaged(best), azimuth_deg)
    is_likelier = likelihood(averaged(best), of_best) > likelihood(own, of_own)
    return float(best) if is_likelier else None

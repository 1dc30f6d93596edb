"""A bundle's network in onnxruntime, its logits on sweeps, and the mirror plane of a category.

Mugs, cars and chairs are nearly their own mirror images. Take objects with a vertical plane of
symmetry at the azimuth m: a camera at the azimuth a sees the mirror image of what it sees from
2 m - a. A trained network knows this only roughly. The mean of its logits for an image and for the
mirror image, with the classes reversed, knows it exactly. Where there is a plane,
`nbv.experiment.estimation.export.onnx_model` writes this mean as the network.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from nbv.core.circle.angles import mirrored_bins
from nbv.core.circle.logits import fit_temperature, mean_log_likelihood
from nbv.errors import BundleError, UserError

Network = Callable[[NDArray[np.uint8]], NDArray[np.float32]]
"""Maps codes (n, side, side) to logits (n, B), or to another output."""

_FATAL = 4


@dataclass(frozen=True)
class Sweep:
    """Views of one object all round at one elevation, with the network's logits (n, B).

    Azimuths (n,) are true; `codes` (n, side, side) uint8 are the crops. Elevation and focal length
    (pixels) are NaN where they are unknown, and `files` () where there are none. Warnings name
    likely mistakes in the frames, a sentence each.
    """

    object_id: str
    sequence: str
    elevation_deg: float
    azimuth_deg: NDArray[np.float64]
    logits: NDArray[np.float32]
    codes: NDArray[np.uint8]
    focal_px: float = float("nan")
    files: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def open_session(model: bytes) -> onnxruntime.InferenceSession:
    """Return an ONNX model ready to run on one CPU core.

    Raise BundleError ``damaged-bundle`` where onnxruntime cannot load it.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    # Errors are raised, so they need not be logged.
    options.log_severity_level = _FATAL
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    # onnxruntime's exceptions have no other common class.
    except Exception as error:
        reason = " ".join(str(error).split())
        raise BundleError(
            "damaged-bundle", f"the bundle's network cannot be run ({reason}); get it again"
        ) from error


def open_network(
    model: bytes, image_side: int, n_outputs: int, output: Literal["logits", "hidden"] = "logits"
) -> Network:
    """Return one output of an ONNX model of `nbv.experiment.estimation.export.onnx_model`.

    Raises
    ------
    BundleError
        ``damaged-bundle`` where onnxruntime cannot load it, or it has other inputs or outputs.
    UserError
        Raised by the network where crops have another shape.
    """
    session = open_session(model)
    ends = {end.name: end.shape for end in (*session.get_inputs(), *session.get_outputs())}
    wanted = {"codes": ["n", 1, image_side, image_side], output: ["n", n_outputs]}
    if {name: ends.get(name) for name in wanted} != wanted:
        raise BundleError(
            "damaged-bundle",
            f"the bundle's network has {ends}, its settings say {wanted}; get it again",
        )

    def network(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        if codes.ndim != 3 or codes.shape[1:] != (image_side, image_side):
            raise UserError(f"crops of shape {codes.shape}: give (n, {image_side}, {image_side})")
        (values,) = session.run([output], {"codes": codes[:, None].astype(np.float32)})
        if not np.isfinite(values).all():
            raise BundleError(
                "damaged-bundle",
                "the bundle's network gives numbers that are not finite; get it again",
            )
        return np.asarray(values)

    return network


def find_mirror_plane(network: Network, sweeps: Sequence[Sweep]) -> float | None:
    """Return the azimuth of the mirror plane under which the true azimuths are likeliest.

    It is in [0, 180) degrees, in steps of half a class; None where `network` alone is more likely
    than its average with any mirror image. Each is compared at its best temperature. The sweeps are
    of calibration objects, which were not trained on, with the logits of `network`. A view every 15
    degrees is enough, because neighbouring views are similar.
    """
    azimuth_deg = np.concatenate([sweep.azimuth_deg for sweep in sweeps])
    plain = np.concatenate([sweep.logits for sweep in sweeps]).astype(np.float64)
    mirrored = np.concatenate([network(sweep.codes[:, :, ::-1]) for sweep in sweeps])
    n_classes = plain.shape[1]
    planes = np.arange(n_classes) * (180.0 / n_classes)

    def averaged(plane_deg: float) -> NDArray[np.float64]:
        return np.asarray((plain + mirrored[:, mirrored_bins(n_classes, plane_deg)]) / 2)

    def likelihood(logits: NDArray[np.float64], temperature: float) -> float:
        return mean_log_likelihood(logits, azimuth_deg, temperature)

    plain_temperature = fit_temperature(plain, azimuth_deg)
    best = max(planes, key=lambda plane: likelihood(averaged(plane), plain_temperature))
    best_temperature = fit_temperature(averaged(best), azimuth_deg)
    is_likelier = likelihood(averaged(best), best_temperature) > likelihood(
        plain, plain_temperature
    )
    return float(best) if is_likelier else None

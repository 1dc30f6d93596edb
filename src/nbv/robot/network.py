"""A bundle's network at work, with onnxruntime."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from nbv.errors import BundleError, UserError

Network = Callable[[NDArray[np.uint8]], NDArray[np.float32]]
"""From codes (n, side, side) to logits (n, B)."""

_FATAL = 4


def open_session(model: bytes) -> onnxruntime.InferenceSession:
    """Return an ONNX model ready to run, on one core of the processor.

    Raises
    ------
    BundleError
        ``damaged-bundle`` where onnxruntime cannot run it.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    # Errors are raised too.
    options.log_severity_level = _FATAL
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    # onnxruntime's exceptions have no common class but this one.
    except Exception as error:
        reason = " ".join(str(error).split())
        raise BundleError(
            "damaged-bundle", f"the bundle's network cannot be run ({reason}); get it again"
        ) from error


def open_network(model: bytes, image_side: int, n_classes: int) -> Network:
    """Return the network of an ONNX model of `nbv.experiment.estimation.export.onnx_model`.

    Parameters
    ----------
    model : bytes
    image_side : int
        Of its crops, pixels.
    n_classes : int
        How many logits it gives.

    Raises
    ------
    BundleError
        ``damaged-bundle`` where onnxruntime cannot run it, or it has other inputs and outputs.
    UserError
        By the network, where crops have another shape.
    """
    session = open_session(model)
    ends = {end.name: end.shape for end in (*session.get_inputs(), *session.get_outputs())}
    wanted = {"codes": ["n", 1, image_side, image_side], "logits": ["n", n_classes]}
    if {name: ends.get(name) for name in wanted} != wanted:
        raise BundleError(
            "damaged-bundle",
            f"the bundle's network has {ends}, its settings say {wanted}; get it again",
        )

    def network(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        if codes.ndim != 3 or codes.shape[1:] != (image_side, image_side):
            raise UserError(f"crops of shape {codes.shape}: give (n, {image_side}, {image_side})")
        (logits,) = session.run(["logits"], {"codes": codes[:, None].astype(np.float32)})
        return np.asarray(logits)

    return network

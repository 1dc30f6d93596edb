"""A bundle's network at work: with onnxruntime where it is installed, else with numpy."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError, nearest
from nbv.robot.bundle import Bundle, weights_fit
from nbv.robot.mirror import Network, mirror_averaged
from nbv.robot.numpy_network import numpy_network

BACKENDS = ("onnx", "numpy")


def open_network(bundle: Bundle, backend: str | None = None) -> Network:
    """Return a bundle's network, on one core of the processor.

    It is that of `nbv.robot.mirror.mirror_averaged` where the bundle has a mirror plane.

    Parameters
    ----------
    bundle : Bundle
    backend : {"onnx", "numpy"}, optional
        None: ``onnx`` where both of its packages are installed, else ``numpy``.

    Raises
    ------
    UserError
        For another backend, where its packages are missing, or where the weights do not fit the
        estimator's settings; by the network, where crops have another shape.
    """
    if backend is None:
        has_onnx = all(find_spec(name) is not None for name in ("onnx", "onnxruntime"))
        backend = "onnx" if has_onnx else "numpy"
    if backend not in BACKENDS:
        raise UserError(f"backend {backend!r}: {nearest(str(backend), BACKENDS)}")
    if not weights_fit(bundle):
        raise UserError("the weights do not fit the network's settings")
    network = _onnx_network(bundle) if backend == "onnx" else _numpy_network(bundle)
    side = bundle.camera.image_side

    def of_crops(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        if codes.ndim != 3 or codes.shape[1:] != (side, side):
            raise UserError(f"crops of shape {codes.shape}: give (n, {side}, {side})")
        return network(codes)

    return of_crops


def _numpy_network(bundle: Bundle) -> Network:
    network = numpy_network(bundle.weights, bundle.estimator)
    return mirror_averaged(network, bundle.mirror_plane_deg)


def _onnx_network(bundle: Bundle) -> Network:
    from nbv.robot.onnx_graph import onnx_model

    try:
        import onnxruntime
    except ImportError as error:
        raise UserError(f"ONNX needs the packages of nbv[onnx] ({error}); install them") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        onnx_model(bundle).SerializeToString(), options, providers=["CPUExecutionProvider"]
    )

    def network(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        (logits,) = session.run(["logits"], {"codes": codes[:, None].astype(np.float32)})
        return np.asarray(logits)

    return network

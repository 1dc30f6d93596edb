"""A bundle's network as ONNX, made of its weights alone: without torch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nbv.bundles.bundle import Bundle
from nbv.errors import UserError
from nbv.estimation.folding import folded_convolutions

if TYPE_CHECKING:
    from onnx import ModelProto

OPSET, IR_VERSION = 17, 8


def onnx_model(bundle: Bundle) -> ModelProto:
    """Return the network from ``codes`` (n, 1, side, side) float32 to ``logits``.

    Convolutions are as of `nbv.estimation.folding.folded_convolutions`.

    Raises
    ------
    UserError
        Where the package onnx is not installed.
    """
    try:
        from onnx import TensorProto, helper, numpy_helper
    except ImportError as error:
        raise UserError(f"ONNX needs the packages of nbv[onnx] ({error}); install them") from error

    nodes: list[Any] = []
    constants: list[Any] = []

    def constant(name: str, value: NDArray[np.float32]) -> str:
        constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    weights, side = bundle.weights, bundle.camera.image_side
    here = "codes"
    convolutions = folded_convolutions(weights, len(bundle.estimator["channels"]))
    for layer, (kernel, bias) in enumerate(convolutions):
        names = constant(f"kernel{layer}", kernel), constant(f"bias{layer}", bias)
        reach = kernel.shape[-1] // 2
        nodes.append(
            helper.make_node(
                "Conv", [here, *names], [f"conv{layer}"], strides=[2, 2], pads=[reach] * 4
            )
        )
        nodes.append(helper.make_node("Relu", [f"conv{layer}"], [f"map{layer}"]))
        here = f"map{layer}"
    nodes.append(helper.make_node("Flatten", [here], ["flat"]))
    for place, (given, made) in {"2": ("flat", "wide"), "4": ("hidden", "logits")}.items():
        names = (
            constant(f"weight{place}", weights[f"{place}.weight"]),
            constant(f"offset{place}", weights[f"{place}.bias"]),
        )
        nodes.append(helper.make_node("Gemm", [given, *names], [made], transB=1))
        if place == "2":
            nodes.append(helper.make_node("Relu", ["wide"], ["hidden"]))
    graph = helper.make_graph(
        nodes,
        f"nbv {bundle.category}",
        [helper.make_tensor_value_info("codes", TensorProto.FLOAT, ["n", 1, side, side])],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["n", weights["4.bias"].size])],
        constants,
    )
    opset = [helper.make_opsetid("", OPSET)]
    return helper.make_model(graph, opset_imports=opset, ir_version=IR_VERSION, producer_name="nbv")

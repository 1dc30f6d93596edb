"""A bundle's network as ONNX, made of its weights alone: without torch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.robot.bundle import Bundle
from nbv.robot.folding import folded_convolutions
from nbv.robot.mirror import mirrored_classes

if TYPE_CHECKING:
    from onnx import ModelProto

OPSET, IR_VERSION = 17, 8


def onnx_model(bundle: Bundle) -> ModelProto:
    """Return the network from ``codes`` (n, 1, side, side) float32 to ``logits``.

    Convolutions are as of `nbv.robot.folding.folded_convolutions`. Where the bundle has a
    mirror plane, the logits are those of `nbv.robot.mirror.mirror_averaged`.

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

    def constant(name: str, value: NDArray[Any]) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, order="C"), name))
        return name

    def whole(name: str, *values: int) -> str:
        return constant(name, np.array(values, dtype=np.int64))

    def node(kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    weights, side, plane = bundle.weights, bundle.camera.image_side, bundle.mirror_plane_deg
    n_classes = weights["4.bias"].size
    here = "codes"
    if plane is not None:
        # Backwards from the last column to the first.
        last_to_first = (whole("last", -1), whole("end", -side - 1), whole("axis", 3))
        mirrored = node("Slice", [here, *last_to_first, whole("step", -1)], "mirrored")
        here = node("Concat", [here, mirrored], "images", axis=0)
    convolutions = folded_convolutions(weights, len(bundle.estimator["channels"]))
    for layer, (kernel, bias) in enumerate(convolutions):
        names = constant(f"kernel{layer}", kernel), constant(f"bias{layer}", bias)
        reach = kernel.shape[-1] // 2
        here = node("Conv", [here, *names], f"conv{layer}", strides=[2, 2], pads=[reach] * 4)
        here = node("Relu", [here], f"map{layer}")
    here = node("Flatten", [here], "flat")

    def linear(place: str, output: str) -> str:
        names = (
            constant(f"weight{place}", weights[f"{place}.weight"]),
            constant(f"offset{place}", weights[f"{place}.bias"]),
        )
        return node("Gemm", [here, *names], output, transB=1)

    here = node("Relu", [linear("2", "wide")], "hidden")
    here = linear("4", "logits" if plane is None else "outputs")
    if plane is not None:
        # The first half are of the images, the second half of their mirror images.
        nodes.append(helper.make_node("Split", [here], ["own", "other"], axis=0))
        backwards = whole("classes", *mirrored_classes(n_classes, plane).tolist())
        node("Mean", ["own", node("Gather", ["other", backwards], "turned", axis=1)], "logits")
    graph = helper.make_graph(
        nodes,
        f"nbv {bundle.category}",
        [helper.make_tensor_value_info("codes", TensorProto.FLOAT, ["n", 1, side, side])],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["n", n_classes])],
        constants,
    )
    opset = [helper.make_opsetid("", OPSET)]
    return helper.make_model(graph, opset_imports=opset, ir_version=IR_VERSION, producer_name="nbv")

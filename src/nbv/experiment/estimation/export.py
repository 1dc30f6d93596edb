"""A trained network as an ONNX model, with its hidden layer as the second output."""

from __future__ import annotations

import copy
import io
import warnings
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import parametrize

from nbv.experiment.estimation.weights import Estimator

OPSET = 17


def onnx_model(estimator: Estimator, mirrored_classes: NDArray[np.intp] | None = None) -> bytes:
    """Return a network as an ONNX model; the same weights give the same bytes in any folder.

    Its input is ``codes`` (n, 1, side, side) float32: crops as depth codes, 0 to 255. Its outputs
    are ``logits`` (n, B) and ``hidden`` (n, H), its hidden layer for the crops as they are.
    Kernels and matrices are rounded to half precision, which halves the model's size; the model
    computes in single precision.

    Parameters
    ----------
    mirrored_classes : ndarray (B,), optional
        The class that each class has in a mirror image. The logits are then the mean of those for
        a crop and for its mirror image; otherwise those for the crop.
    """
    network = cast(nn.Sequential, copy.deepcopy(estimator.network).cpu())
    for layer in list(network.modules()):
        if isinstance(layer, nn.Conv2d | nn.Linear):
            half = layer.weight.detach().half().contiguous()
            layer.weight = nn.Parameter(half, requires_grad=False)
            parametrize.register_parametrization(layer, "weight", _AsSingle(), unsafe=True)
    side, written = estimator.image_side, io.BytesIO()
    with warnings.catch_warnings():
        # The exporter that replaces this one writes the folder's path into the model.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            _OnCodes(network, side, mirrored_classes).eval(),
            (torch.zeros(2, 1, side, side),),
            written,  # type: ignore[arg-type]  # torch's annotations lack it
            input_names=["codes"],
            output_names=["logits", "hidden"],
            dynamic_axes={name: {0: "n"} for name in ("codes", "logits", "hidden")},
            opset_version=OPSET,
            # It would write the weights in single precision.
            do_constant_folding=False,
            dynamo=False,
        )
    return written.getvalue()


class _AsSingle(nn.Module):
    def forward(self, weight: torch.Tensor) -> torch.Tensor:
        return weight.float()


class _OnCodes(nn.Module):
    """A network of `build_network` with the input and the outputs of `onnx_model`."""

    def __init__(
        self, network: nn.Sequential, image_side: int, mirrored_classes: NDArray[np.intp] | None
    ) -> None:
        super().__init__()
        self.to_hidden, self.to_logits = network[:-1], network[-1]
        self.side = image_side
        self.mirrored = None if mirrored_classes is None else torch.from_numpy(mirrored_classes)

    def forward(self, codes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        if self.mirrored is not None:
            both = torch.stack([codes, codes.flip(-1)], dim=1)
            codes = both.reshape(-1, 1, self.side, self.side)
        # As `nbv.experiment.estimation.hardware.to_input` does.
        hidden = self.to_hidden(codes / 128)
        logits = self.to_logits(hidden)
        if self.mirrored is None:
            return logits, hidden
        plain, mirrored = logits.reshape(-1, 2, self.to_logits.out_features).unbind(1)
        mean = (plain + mirrored.index_select(1, self.mirrored)) / 2
        return mean, hidden.reshape(-1, 2, self.to_logits.in_features)[:, 0]

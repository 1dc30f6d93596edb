"""Estimators on disk: safetensors, never pickle, with what they were trained on."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.torch
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.functional import conv2d, linear

from nbv.checksums import sha256_of
from nbv.errors import UserError
from nbv.estimation.folding import folded_convolutions
from nbv.estimation.hardware import Hardware, use_one_thread
from nbv.estimation.networks import build_network
from nbv.estimation.warm_start import with_category
from nbv.files import damaged, readable, replacing


@dataclass(frozen=True)
class Estimator:
    """A trained network and its history.

    Attributes
    ----------
    network : torch.nn.Module
        In evaluation mode.
    settings : mapping
        The estimator's settings as it was trained with them.
    image_side : int
        Pixels.
    trained_on : sequence of str
        The objects it has seen; ``<category>/<object>`` where objects of all categories meet.
    started_from : mapping, optional
        ``path`` (from the estimator's own folder) and ``sha256`` of the estimator whose weights it
        started from.
    """

    network: nn.Module
    settings: Mapping[str, Any]
    image_side: int
    trained_on: Sequence[str]
    started_from: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Start:
    """Weights to start a training from.

    Attributes
    ----------
    network : torch.nn.Module
    origin : mapping
        See `Estimator.started_from`.
    """

    network: nn.Module
    origin: Mapping[str, str]


def save_estimator(path: str | Path, estimator: Estimator, hardware: Hardware) -> None:
    """Write weights and history to a `.safetensors` file."""
    history = {
        "settings": dict(estimator.settings),
        "image_side": estimator.image_side,
        "trained_on": list(estimator.trained_on),
        "hardware": str(hardware),
    }
    if estimator.started_from is not None:
        history["started_from"] = dict(estimator.started_from)
    tensors = {
        name: tensor.detach().cpu().contiguous()
        for name, tensor in estimator.network.state_dict().items()
    }
    metadata = {"nbv": json.dumps(history, sort_keys=True)}
    with replacing(path) as temporary:
        # Not save_file: its error on a full disk is not the system's.
        temporary.write_bytes(safetensors.torch.save(tensors, metadata=metadata))


def load_estimator(path: str | Path, hardware: Hardware) -> Estimator:
    """Read what `save_estimator` wrote.

    Raises
    ------
    UserError
        Where the file is no estimator of this project.
    """
    with readable(path):
        with safetensors.safe_open(path, framework="pt") as stored:
            metadata = stored.metadata() or {}
        if "nbv" not in metadata:
            raise damaged(path, "not an estimator of nbv")
        history = json.loads(metadata["nbv"])
        network = build_network(history["settings"], history["image_side"])
        network.load_state_dict(safetensors.torch.load_file(path))
        estimator = Estimator(
            network.eval(),
            history["settings"],
            history["image_side"],
            history["trained_on"],
            history.get("started_from"),
        )
        if not all(bool(values.isfinite().all()) for values in network.state_dict().values()):
            raise damaged(path, "a weight is not finite")
    estimator.network.to(hardware.device)
    return estimator


def read_start(
    path: str, category: str, object_ids: Sequence[str], output: str, hardware: Hardware
) -> Start:
    """Read what a training is to start from.

    Parameters
    ----------
    path : str
        An estimator of the same category, or a network that all categories were pretrained with.
    category : str
    object_ids : sequence of str
        The objects to train on.
    output : str
        Where the new estimator is to lie.
    hardware : Hardware

    Raises
    ------
    UserError
        Where it has seen other objects of the category: one of them may be there to calibrate or
        to test with. Also as of `load_estimator`.
    """
    stored = load_estimator(path, hardware)
    seen, own = set(stored.trained_on), set(object_ids)
    qualified = set(with_category(category, object_ids))
    if seen != own and {name for name in seen if name.startswith(f"{category}/")} != qualified:
        raise damaged(path, f"it has seen other objects of {category} than what starts from it")
    relative = os.path.relpath(path, Path(output).parent)
    return Start(stored.network, {"path": relative, "sha256": sha256_of(path)})


def weights_of(estimator: Estimator) -> dict[str, NDArray[np.float32]]:
    """Return the weights of an estimator by their names, single precision."""
    return {
        name: tensor.detach().cpu().contiguous().numpy().astype(np.float32)
        for name, tensor in estimator.network.state_dict().items()
        if tensor.is_floating_point()
    }


def network_of(
    weights: Mapping[str, NDArray[np.float32]], settings: Mapping[str, Any], image_side: int
) -> Callable[[NDArray[np.uint8]], NDArray[np.float32]]:
    """Return the network of some weights, from codes (n, side, side) to outputs (n, k).

    It computes on one core of the processor, in single precision, without the calls of modules and
    with `nbv.estimation.folding.folded_convolutions`: a single image takes a quarter less time so.

    Raises
    ------
    UserError
        Where the weights do not fit the settings.
    """
    use_one_thread()
    tensors = {name: torch.from_numpy(np.array(array)) for name, array in weights.items()}
    try:
        # Without the number of batches that normalisation has seen, which training alone needs.
        missing, unknown = build_network(settings, image_side).load_state_dict(
            tensors, strict=False
        )
        if unknown or any(not name.endswith("num_batches_tracked") for name in missing):
            raise RuntimeError("names")
    except (RuntimeError, TypeError) as error:
        raise UserError("the weights do not fit the network's settings") from error
    convolutions = [
        (
            torch.from_numpy(kernel).contiguous(memory_format=torch.channels_last),
            torch.from_numpy(bias),
        )
        for kernel, bias in folded_convolutions(weights, len(settings["channels"]))
    ]
    hidden, last = ((tensors[f"{at}.weight"], tensors[f"{at}.bias"]) for at in (2, 4))

    def run(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
        with torch.inference_mode():
            values = torch.from_numpy(codes[:, None].astype(np.float32))
            for kernel, bias in convolutions:
                reach = kernel.shape[-1] // 2
                values = conv2d(values, kernel, bias, stride=2, padding=reach).relu_()
            values = linear(values.flatten(1), *hidden).relu_()
            return np.asarray(linear(values, *last).numpy())

    return run

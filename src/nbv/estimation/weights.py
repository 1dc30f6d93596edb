"""Estimators on disk: safetensors, never pickle, with what they were trained on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
from torch import nn

from nbv.estimation.hardware import Hardware
from nbv.estimation.networks import build_network
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
        The objects it has seen.
    """

    network: nn.Module
    settings: Mapping[str, Any]
    image_side: int
    trained_on: Sequence[str]


def save_estimator(path: str | Path, estimator: Estimator, hardware: Hardware) -> None:
    """Write weights and history to a `.safetensors` file."""
    history = {
        "settings": dict(estimator.settings),
        "image_side": estimator.image_side,
        "trained_on": list(estimator.trained_on),
        "hardware": str(hardware),
    }
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
            network.eval(), history["settings"], history["image_side"], history["trained_on"]
        )
        if not all(bool(values.isfinite().all()) for values in network.state_dict().values()):
            raise damaged(path, "a weight is not finite")
    estimator.network.to(hardware.device)
    return estimator

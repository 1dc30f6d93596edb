"""Files of estimators: safetensors, never pickle, with the training history."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
import torch
from torch import nn

from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.networks import build_network
from nbv.files import damaged, readable, replacing, sha256_of


@dataclass(frozen=True)
class Estimator:
    """A trained network and its training history.

    Attributes
    ----------
    network : torch.nn.Module
        In evaluation mode.
    settings : mapping
        The estimator's settings at training.
    image_side : int
        Pixels.
    trained_on : sequence of str
        Its training objects; ``<category>/<object>`` where it was trained on all categories.
    started_from : mapping, optional
        ``path`` (relative to the estimator's folder) and ``sha256`` of the estimator whose weights
        it started from.
    mirror_plane_deg : float, optional
        The azimuth of its objects' plane of symmetry, where it was trained on mirror images too. An
        estimate is then the mean of an image's and its mirror image's.
    """

    network: nn.Module
    settings: Mapping[str, Any]
    image_side: int
    trained_on: Sequence[str]
    started_from: Mapping[str, str] | None = None
    mirror_plane_deg: float | None = None


@dataclass(frozen=True)
class Start:
    """Weights of all layers, or of all but the last, to start a training from.

    `origin` is the new estimator's `Estimator.started_from`.
    """

    weights: Mapping[str, torch.Tensor]
    origin: Mapping[str, str]


def save_estimator(path: str | Path, estimator: Estimator, hardware: Hardware) -> None:
    """Write weights and training history to a `.safetensors` file."""
    history = {
        "settings": dict(estimator.settings),
        "image_side": estimator.image_side,
        "trained_on": list(estimator.trained_on),
        "hardware": str(hardware),
    }
    if estimator.started_from is not None:
        history["started_from"] = dict(estimator.started_from)
    if estimator.mirror_plane_deg is not None:
        history["mirror_plane_deg"] = estimator.mirror_plane_deg
    tensors = {
        name: tensor.detach().cpu().contiguous()
        for name, tensor in estimator.network.state_dict().items()
    }
    metadata = {"nbv": json.dumps(history, sort_keys=True)}
    with replacing(path) as temporary:
        # save_file would hide the system's error on a full disk.
        temporary.write_bytes(safetensors.torch.save(tensors, metadata=metadata))


def load_estimator(path: str | Path, hardware: Hardware) -> Estimator:
    """Read a file of `save_estimator`.

    Raises
    ------
    UserError
        Where the file does not hold an estimator of this project.
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
            history.get("mirror_plane_deg"),
        )
        if not all(bool(values.isfinite().all()) for values in network.state_dict().values()):
            raise damaged(path, "a weight is not finite")
    estimator.network.to(hardware.device)
    return estimator


def read_start(
    path: str, category: str, object_ids: Sequence[str], output: str, hardware: Hardware
) -> Start:
    """Read the weights that a training starts from.

    Parameters
    ----------
    path : str
        An estimator of the same category, a network that was pretrained on all categories, or the
        depth features, whose last layer the training does not take.
    object_ids : sequence of str
        The training objects.
    output : str
        The path of the new estimator.

    Raises
    ------
    UserError
        Where it was trained on other objects of the category, which may be calibration or test
        objects. Also as `load_estimator` raises.
    """
    origin = {"path": os.path.relpath(path, Path(output).parent), "sha256": sha256_of(path)}
    with readable(path):
        tensors = safetensors.torch.load_file(path)
    if tensors.pop("onnx", None) is not None:
        last = max(tensors).partition(".")[0]
        kept = {k: tensor for k, tensor in tensors.items() if not k.startswith(f"{last}.")}
        return Start(kept, origin)
    stored = load_estimator(path, hardware)
    seen, wanted = set(stored.trained_on), set(object_ids)
    qualified = set(with_category(category, object_ids))
    if seen != wanted and {name for name in seen if name.startswith(f"{category}/")} != qualified:
        raise damaged(path, f"it was trained on other objects of {category}")
    return Start(stored.network.state_dict(), origin)


def with_category(category: str, object_ids: Sequence[str]) -> list[str]:
    """Return ids ``<category>/<object>``, unique over all categories."""
    return [f"{category}/{object_id}" for object_id in object_ids]

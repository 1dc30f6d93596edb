"""The network of the depth features: its training, and the file that ships."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import safetensors.torch
import torch
from torch import nn

from nbv.core.circle.angles import mirrored_bins
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.export import onnx_model
from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.outputs import direction_targets
from nbv.experiment.estimation.training import fit_network
from nbv.experiment.estimation.weights import Estimator
from nbv.files import replacing


def train_features(
    images: Sequence[DepthImages],
    categories: Sequence[str],
    mirror_planes_deg: Mapping[str, float],
    settings: Mapping[str, Any],
    hardware: Hardware,
    seed: int,
) -> Estimator:
    """Train one regressor on all categories, half of each batch mirrored.

    Each category has outputs (cos, sin) of its own, so that the hidden layer need not tell
    categories apart. `images` are of each category and elevation, all with the same number of
    views, and `categories` are theirs. `mirror_planes_deg` has the azimuth of each category's plane
    of symmetry. Other parameters as in `nbv.experiment.estimation.training.train_network`.
    """
    names = sorted(set(categories))
    n_views, side = images[0].codes.shape[1:3]
    of_views = direction_targets(settings, n_views)
    targets, mirrored = [], []
    for category, each in zip(categories, images, strict=True):
        of_category = np.full((n_views, 2 * len(names)), np.nan, dtype=np.float32)
        first = 2 * names.index(category)
        of_category[:, first : first + 2] = of_views
        plane = mirrored_bins(n_views, mirror_planes_deg[category])
        targets.append(np.tile(of_category, (len(each.codes), 1)))
        mirrored.append(np.tile(of_category[plane], (len(each.codes), 1)))
    torch.manual_seed(seed)
    network = cast(nn.Sequential, build_network(settings, side))
    network[-1] = nn.Linear(settings["hidden"], 2 * len(names))
    fit_network(
        network.to(hardware.device),
        np.concatenate([each.codes for each in images]),
        np.concatenate(targets),
        _masked_loss,
        settings,
        hardware,
        seed,
        np.concatenate(mirrored),
    )
    return Estimator(network, settings, side, ())


def _masked_loss(outputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
    """Return the mean squared error of the outputs that have a target; the others' is NaN."""
    return (outputs - targets)[~targets.isnan()].square().mean()


def save_features(path: str, trained: Estimator, provenance: Mapping[str, Any]) -> None:
    """Write a file for `nbv.experiment.estimation.features.Features.load`.

    It holds the ONNX model, and the weights for `nbv.experiment.estimation.weights`, both with
    kernels and matrices in half precision.
    """
    tensors = {
        name: (tensor.half() if tensor.ndim > 1 else tensor).cpu().contiguous()
        for name, tensor in trained.network.state_dict().items()
    }
    model = np.frombuffer(onnx_model(trained), dtype=np.uint8)
    tensors["onnx"] = torch.from_numpy(model.copy())
    sizes = {"image_side": trained.image_side, "n_features": trained.settings["hidden"]}
    metadata = {"nbv": json.dumps({**provenance, **sizes}, sort_keys=True)}
    with replacing(path) as temporary:
        temporary.write_bytes(safetensors.torch.save(tensors, metadata=metadata))

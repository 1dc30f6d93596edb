"""Training of an estimator."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from nbv.core.circle.angles import mirrored_bins
from nbv.data.depth_images import DepthImages
from nbv.errors import UserError
from nbv.experiment.estimation.hardware import Hardware, scaled
from nbv.experiment.estimation.networks import KINDS, Loss, build_network
from nbv.experiment.estimation.outputs import Targets
from nbv.experiment.estimation.weights import Estimator, Start

log = logging.getLogger(__name__)

PROGRESS_SECONDS = 5.0


def train_estimator(
    images: DepthImages,
    object_ids: Sequence[str],
    settings: Mapping[str, Any],
    hardware: Hardware,
    seed: int,
    start: Start | None = None,
    mirror_plane_deg: float | None = None,
) -> Estimator:
    """Train an estimator on some objects, whose ids are kept with the weights.

    With the azimuth of the objects' plane of symmetry, it is trained on mirror images too. Same
    other parameters and errors as `train_network`; also raises as
    `nbv.data.depth_images.DepthImages.of` does.
    """
    weights, origin = (start.weights, start.origin) if start else (None, None)
    planes = None if mirror_plane_deg is None else [mirror_plane_deg] * len(object_ids)
    network = train_network(images.of(object_ids), settings, hardware, seed, weights, planes)
    side = images.codes.shape[-1]
    return Estimator(network, settings, side, object_ids, origin, mirror_plane_deg)


def train_network(
    codes: NDArray[np.uint8],
    settings: Mapping[str, Any],
    hardware: Hardware,
    seed: int,
    start: Mapping[str, torch.Tensor] | None = None,
    mirror_planes_deg: Sequence[float] | None = None,
) -> nn.Module:
    """Train a network on its kind's targets and loss, with AdamW and a one-cycle schedule.

    Parameters
    ----------
    codes : ndarray (n_objects, n_views, side, side) uint8
        Training images; view k of n has the azimuth 360 k / n.
    settings : mapping
        ``kind, channels, hidden, epochs, batch_size, learning_rate, weight_decay``, and further
        settings of the kind.
    seed : int
        Seeds the weights and the order of the images: the same seed on the same machine gives the
        same bits.
    start : mapping of str to Tensor, optional
        Weights of a network of the same size that the training starts from. What it does not name,
        such as the last layer's, starts from random weights.
    mirror_planes_deg : sequence of float, optional
        The azimuth of each object's plane of symmetry, a multiple of half a view's step. With them,
        half of each batch is mirrored.

    Returns
    -------
    torch.nn.Module
        In evaluation mode, on the hardware's device.

    Raises
    ------
    UserError
        Where the loss or a weight becomes non-finite, or the start has another size.
    """
    n_objects, n_views, side, _ = codes.shape
    kind = KINDS[settings["kind"]]
    torch.manual_seed(seed)
    network = build_network(settings, side).to(hardware.device)
    if start is not None:
        _set_weights(network, start)
    of_views = kind.targets(settings, n_views)
    targets, mirrored = np.tile(of_views, (n_objects, 1)), None
    if mirror_planes_deg is not None:
        views = [mirrored_bins(n_views, plane) for plane in mirror_planes_deg]
        mirrored = of_views[np.concatenate(views)]
    return fit_network(network, codes, targets, kind.loss, settings, hardware, seed, mirrored)


def fit_network(
    network: nn.Module,
    codes: NDArray[np.uint8],
    targets: Targets,
    loss_of: Loss,
    settings: Mapping[str, Any],
    hardware: Hardware,
    seed: int,
    mirrored_targets: Targets | None = None,
) -> nn.Module:
    """Train a network's weights on images and targets, with AdamW and a one-cycle schedule.

    Parameters
    ----------
    network : torch.nn.Module
        On the hardware's device.
    codes : ndarray (..., side, side) uint8
        n images.
    targets : ndarray (n, k) float32
    loss_of : callable
        ``loss_of(outputs, targets)``, a scalar tensor.
    settings : mapping
        ``epochs, batch_size, learning_rate, weight_decay``.
    hardware, seed
        See `train_network`.
    mirrored_targets : ndarray (n, k) float32, optional
        The targets of the mirror images. With them, half of each batch is mirrored.

    Returns
    -------
    torch.nn.Module
        The same network, in evaluation mode.
    """
    device, side = hardware.device, codes.shape[-1]
    # As bytes: in single precision, 900,000 images would take 15 GB.
    images = torch.from_numpy(np.ascontiguousarray(codes).reshape(-1, 1, side, side)).to(device)
    wanted = torch.from_numpy(targets).to(device)
    of_mirrored = (
        None if mirrored_targets is None else torch.from_numpy(mirrored_targets).to(device)
    )
    n_images, batch_size, n_epochs = len(images), settings["batch_size"], settings["epochs"]
    batches = max(n_images // batch_size, 1)
    optimiser = torch.optim.AdamW(
        network.parameters(),
        lr=settings["learning_rate"],
        weight_decay=settings["weight_decay"],
        fused=True,
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, max_lr=settings["learning_rate"], total_steps=n_epochs * batches
    )
    order = torch.Generator().manual_seed(seed)
    log.info("training on %d images (%s)", n_images, hardware)
    started = reported = time.perf_counter()

    def report(epoch: int, seen: int, mean_loss: float) -> None:
        done = epoch * n_images + seen
        rate = done / max(time.perf_counter() - started, 1e-9)
        left = (n_epochs * n_images - done) / max(rate, 1e-9)
        log.info(
            "epoch %d/%d, %3.0f %%: loss %.4f, %.0f images/s, %.0f s left",
            *(epoch + 1, n_epochs, 100 * seen / n_images, mean_loss, rate, left),
        )

    network.train()
    for epoch in range(n_epochs):
        permutation = torch.randperm(n_images, generator=order).to(device)
        running = torch.zeros((), device=device)
        for batch in range(batches):
            chosen = permutation[batch * batch_size : (batch + 1) * batch_size]
            # Same as images[chosen], in half the time.
            shown, target = images.index_select(0, chosen), wanted[chosen]
            if of_mirrored is not None:
                half = len(chosen) // 2
                shown[:half] = shown[:half].flip(-1)
                target[:half] = of_mirrored[chosen[:half]]
            network.zero_grad(set_to_none=True)
            with hardware.autocast():
                output = network(scaled(shown, hardware))
            loss = loss_of(output.float(), target)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
            running += loss.detach()
            now = time.perf_counter()
            if now - reported > PROGRESS_SECONDS:
                _check_finite(network, running, epoch, settings)
                report(epoch, len(chosen) + batch * batch_size, float(running) / (batch + 1))
                reported = now
        _check_finite(network, running, epoch, settings)
        report(epoch, n_images, float(running) / batches)
    return network.eval()


def _set_weights(network: nn.Module, start: Mapping[str, torch.Tensor]) -> None:
    try:
        network.load_state_dict({**network.state_dict(), **start})
    except RuntimeError as error:
        raise UserError(
            "training: the network to start from has another size: train it again with the "
            "same estimator.kind, channels, hidden, n_classes and camera.image_side"
        ) from error


def _check_finite(
    network: nn.Module, loss: torch.Tensor, epoch: int, settings: Mapping[str, Any]
) -> None:
    if all(bool(torch.isfinite(values).all()) for values in (loss, *network.parameters())):
        return
    raise UserError(
        f"training: the loss or a weight is not finite in epoch {epoch + 1}: lower "
        f"estimator.learning_rate={settings['learning_rate']:g} or "
        f"estimator.weight_decay={settings['weight_decay']:g}"
    )

"""Training throughput: the project's loop and data path against the bare steps of its network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from nbv.experiment.estimation.hardware import Hardware, choose_hardware, to_input, use_one_thread
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.training import train_network
from performance.figures import Figure, Target
from performance.settings import configuration
from performance.timing import Times, Work, take_turns

TARGET = Target(0.90)
N_VIEWS, SIDE = 360, 64


def run(quick: bool) -> list[Figure]:
    use_one_thread()
    settings = {**configuration()["estimator"], "epochs": 1 if quick else 2}
    hardware = choose_hardware("cpu", settings["precision"])
    n_objects = 3 if quick else 20
    times = bare_and_own(settings, hardware, SIDE, n_objects, 1 if quick else 8)
    n_images = n_objects * N_VIEWS
    steps = n_images // settings["batch_size"] * settings["epochs"]
    bare, own = (steps * settings["batch_size"] / times.typical(column) for column in (0, 1))
    detail = (
        f"{own:,.0f} against {bare:,.0f} images/s ({hardware}, one thread); "
        f"{settings['epochs']} epochs of {n_images:,} images in batches of {settings['batch_size']}"
    )
    return [Figure("training: own loop / bare steps", times.ratio(0, 1), TARGET, detail)]


def bare_and_own(
    settings: Mapping[str, Any], hardware: Hardware, side: int, n_objects: int, n_rounds: int
) -> Times:
    """Return the times of as many bare steps as a training takes, and of the training.

    20 objects are more than processors' caches hold: images must come from memory, as they do in
    the paper's run.
    """
    n_images = n_objects * N_VIEWS
    codes = random_codes(n_images, side).reshape(n_objects, N_VIEWS, side, side)
    steps = n_images // settings["batch_size"] * settings["epochs"]
    works = [
        bare_steps(settings, hardware, side, steps),
        lambda: train_network(codes, settings, hardware, seed=0),
    ]
    bare_steps(settings, hardware, side, 3)()
    train_network(codes[:3], {**settings, "epochs": 1}, hardware, seed=0)
    return take_turns(works, n_rounds, warm_up=False)


def random_codes(n_images: int, side: int) -> NDArray[np.uint8]:
    """Return depth codes, (n_images, side, side) uint8."""
    rng = np.random.default_rng(0)
    return rng.integers(0, 256, (n_images, side, side), dtype=np.uint8)


def bare_steps(settings: Mapping[str, Any], hardware: Hardware, side: int, n_steps: int) -> Work:
    """Return forward, backward and step of the project's network on one resident batch."""
    torch.manual_seed(0)
    network = build_network(settings, side).to(hardware.device).train()
    images = to_input(random_codes(settings["batch_size"], side), hardware)
    targets = torch.randn(len(images), 2, device=hardware.device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=1e-3, fused=True)

    def work() -> None:
        for _ in range(n_steps):
            optimiser.zero_grad(set_to_none=True)
            with hardware.autocast():
                output = network(images)
            loss = nn.functional.mse_loss(output.float(), targets)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()

    return work

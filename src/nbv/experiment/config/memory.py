"""How much memory a run's largest jobs need at the least, so that no run starts in vain.

The figures are lower bounds: what is refused cannot be run, and what is not refused may still run
out of memory. A training network's parameters and images are those of `nbv.experiment.estimation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import psutil

from nbv.errors import UserError

LARGEST_NODE_BYTES = 4 * 2**40
"""More than a node of any cluster has; jobs that run elsewhere are compared with it."""

# `nbv.experiment.estimation.inference.INFERENCE_BATCH`, which is not imported: torch would come with it.
_INFERENCE_BATCH = 256

_VIEWS = 360
_UNITS = ("B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB")


@dataclass(frozen=True)
class Need:
    """What one part of a job keeps in memory.

    Attributes
    ----------
    job : str
        What the job does.
    keys : tuple of str
        The settings that decide.
    n_bytes : int
        At the least.
    """

    job: str
    keys: tuple[str, ...]
    n_bytes: int


def available_bytes(*, is_local: bool) -> int:
    """Return the memory of this machine, or for jobs that run elsewhere `LARGEST_NODE_BYTES`."""
    return psutil.virtual_memory().total if is_local else LARGEST_NODE_BYTES


def check_memory(settings: Mapping[str, Any], n_objects: int, limit_bytes: int) -> None:
    """Check that each job's least need of memory is within a limit.

    Parameters
    ----------
    settings : mapping
        A configuration, from `nbv.experiment.config.load_config`.
    n_objects : int
        Of the largest category; 0 where that is not known yet.
    limit_bytes : int
        From `available_bytes`. What an accelerator (``estimator.device=cuda`` or ``mps``) holds is
        no part of a machine's memory and is compared with `LARGEST_NODE_BYTES` at least.

    Raises
    ------
    UserError
        One line with the settings that decide and both amounts.
    """
    found = needs(settings, n_objects)
    elsewhere = settings["estimator"]["device"] in ("cuda", "mps")
    for job in dict.fromkeys(need.job for need in found):
        parts = [need for need in found if need.job == job]
        total = sum(need.n_bytes for need in parts)
        of_network = elsewhere and job in ("training", "estimating")
        limit = max(limit_bytes, LARGEST_NODE_BYTES) if of_network else limit_bytes
        if total > limit:
            largest = max(parts, key=lambda need: need.n_bytes)
            given = ", ".join(f"{key}={_value(settings, key)}" for key in largest.keys)
            advice = "lower it" if len(largest.keys) == 1 else "lower one of them"
            raise UserError(
                f"{given}: {job} needs at least {_amount(total)} of memory, and there are "
                f"{_amount(limit)}; {advice}"
            )


def needs(settings: Mapping[str, Any], n_objects: int) -> list[Need]:
    """Return what the jobs that can grow without bound keep in memory, part by part.

    Parameters as of `check_memory`.
    """
    side, estimator = settings["camera"]["image_side"], settings["estimator"]
    n_images = _VIEWS * training_objects(settings, n_objects)
    number_bytes = 4 if estimator["precision"] == "float32" else 2
    maps = _map_sizes(estimator["channels"], side)
    # Each map is kept for the gradient, and again behind its normalisation; the first one has none.
    of_an_image = 2 * sum(maps) - maps[0]
    batch = min(estimator["batch_size"], n_images)
    widest = max(before + after for before, after in pairwise([side**2, *maps]))
    n_resamples = settings["n_resamples"]
    network = ("estimator.hidden", "estimator.channels", "camera.image_side")
    layers = ("estimator.channels", "camera.image_side")
    return [
        # float32 depth and its code, of one object's views.
        Need("rendering", ("camera.image_side",), 5 * _VIEWS * side**2),
        # The code and the network's input.
        Need(
            "training",
            ("n_objects", "camera.image_side"),
            (1 + number_bytes) * n_images * side**2,
        ),
        # The parameters, their gradients, and AdamW's two moments, all float32.
        Need("training", network, 4 * 4 * n_parameters(estimator, side)),
        Need("training", ("estimator.batch_size", *layers), batch * of_an_image * number_bytes),
        Need("estimating", layers, _INFERENCE_BATCH * widest * number_bytes),
        # Draws, their cells and counts; or counts, their weights and 1,001 quantiles.
        Need(
            "resampling",
            ("n_resamples", "n_objects"),
            n_resamples * (16 * n_objects + max(8 * n_objects, 9 * 1001)),
        ),
    ]


def training_objects(settings: Mapping[str, Any], n_objects: int) -> int:
    """Return how many objects the largest training of a fold sees."""
    rest: int = n_objects - n_objects // settings["n_folds"]
    if settings["calibration"] == "crossfit" or rest < 2:
        return rest
    fraction: float = settings["calibration_fraction"]
    return rest - min(max(round(fraction * rest), 1), rest - 1)


def n_parameters(estimator: Mapping[str, Any], image_side: int) -> int:
    """Return the number of parameters of the networks of `nbv.experiment.estimation.networks`."""
    channels: list[int] = estimator["channels"]
    hidden: int = estimator["hidden"]
    n_outputs: int = estimator.get("n_classes", 2)
    first = (25 + 1) * channels[0]
    # Kernels without bias, and the scale and shift of a normalisation.
    others = sum(9 * before * after + 2 * after for before, after in pairwise(channels))
    features = _map_sizes(channels, image_side)[-1]
    return first + others + (features + 1) * hidden + (hidden + 1) * n_outputs


def _map_sizes(channels: list[int], image_side: int) -> list[int]:
    """Return the numbers in each layer's map of one image; every layer halves the side."""
    sizes, side = [], image_side
    for depth in channels:
        side = (side + 1) // 2
        sizes.append(depth * side**2)
    return sizes


def _value(settings: Mapping[str, Any], key: str) -> Any:
    value: Any = settings
    for part in key.split("."):
        value = value[part]
    return value


def _amount(n_bytes: int) -> str:
    power = min((max(n_bytes, 1).bit_length() - 1) // 10, len(_UNITS) - 1)
    return f"{n_bytes / 1024**power:.3g} {_UNITS[power]}"

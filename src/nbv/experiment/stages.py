"""Stages of training: what a training starts from, and its epochs and rate."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final, Literal

PRETRAINED: Final = "pretrained"
FEATURES: Final = "features"
Start = int | Literal["pretrained", "features"] | None
"""What a training starts from: the estimator of an elevation, the network of all categories, the
network of the depth features, or None for random weights."""

Stage = Literal["training", "pretraining", "fine_tuning", "next_elevation"]
"""From random weights; of all categories together; of that network, or that of the features; from
the estimator of a lower elevation."""
STAGES: tuple[Stage, ...] = ("training", "pretraining", "fine_tuning", "next_elevation")


def start_of(warm_start: str, elevations_deg: Collection[int], elevation: int) -> Start:
    """Return what the estimator of one elevation starts from.

    A category's elevation can start from the estimator one elevation lower, and its lowest
    elevation from a network that was pretrained with all categories of the fold. A training that
    starts so takes fewer epochs. No calibration or test object of the fold is seen on the way. The
    network of the depth features has seen no object of any experiment. `warm_start` is the
    configuration's ``estimator.warm_start``, and `elevations_deg` are all of the category.
    """
    if warm_start == "features":
        return FEATURES
    lower = [other for other in elevations_deg if other < elevation]
    if lower and warm_start in ("elevations", "both"):
        return max(lower)
    return PRETRAINED if warm_start in ("categories", "both") else None


def stage_from(start: Start) -> Stage:
    """Return the stage of a training by what it starts from; see `start_of`."""
    if start is None:
        return "training"
    return "fine_tuning" if start in (PRETRAINED, FEATURES) else "next_elevation"


def stage_settings(
    estimator: Mapping[str, Any], stage: Stage, epochs: int | None = None
) -> dict[str, Any]:
    """Return the settings of one stage of training, without those of the other stages.

    `estimator` is that section of a configuration; `epochs` are those of a training from random
    weights, by default ``estimator.epochs``. Other stages scale theirs in the same proportion, to
    at least one.
    """
    schedule: Mapping[str, Any] = estimator if stage == "training" else estimator[stage]
    share = 1.0 if epochs is None else epochs / estimator["epochs"]
    others = ("warm_start", "mirror_images", *STAGES)
    return {key: value for key, value in estimator.items() if key not in others} | {
        "epochs": max(round(schedule["epochs"] * share), 1),
        "learning_rate": schedule["learning_rate"],
    }

"""What types cannot say of a configuration: ranges, and names that other keys make valid."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from nbv.amounts import enough_objects
from nbv.errors import UserError, nearest

# Names that belong to code rather than to a file of a configuration group.
CHOICES = {
    "calibration": ("holdout", "crossfit"),
    "camera.framing": ("silhouette", "axis"),
    "dataset.centre": ("box", "origin"),
    "density.reading": ("given_estimate", "given_truth"),
    "density.spread": ("entropy", "circular_variance"),
    "estimator.device": ("auto", "cpu", "cuda", "mps"),
    "estimator.precision": ("auto", "bfloat16", "float32"),
}


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise UserError(message)


def value_of(config: Mapping[str, Any], key: str) -> Any:
    """Return the value of a dotted key."""
    value: Any = config
    for part in key.split("."):
        value = value[part]
    return value


def validate(config: Mapping[str, Any]) -> None:
    """Check values that types cannot: ranges and names.

    Raises
    ------
    UserError
        One line that names the key.
    """
    positive = {
        "n_folds (2 or more)": config["n_folds"] >= 2,
        "n_objects (enough to train, calibrate and test in each of n_folds, or null for all)": (
            config["n_objects"] is None or enough_objects(config["n_objects"], config["n_folds"])
        ),
        "seed (0 or more)": config["seed"] >= 0,
        "estimator.weight_decay (0 or more)": config["estimator"]["weight_decay"] >= 0,
        "calibration_fraction (between 0 and 1)": 0 < config["calibration_fraction"] < 1,
        "n_resamples (100 or more)": config["n_resamples"] >= 100,
        "estimator.epochs (1 or more)": config["estimator"]["epochs"] >= 1,
        "estimator.batch_size (2 or more)": config["estimator"]["batch_size"] >= 2,
        "estimator.hidden (1 or more)": config["estimator"]["hidden"] >= 1,
        "estimator.channels (one or more, each 1 or more)": len(config["estimator"]["channels"]) > 0
        and min(config["estimator"]["channels"]) >= 1,
        "estimator.learning_rate (above 0)": config["estimator"]["learning_rate"] > 0,
        "camera.image_side (8 or more)": config["camera"]["image_side"] >= 8,
        "camera.distance (above 1, in object diagonals)": config["camera"]["distance"] > 1,
        "camera.fov_deg (between 0 and 180)": 0 < config["camera"]["fov_deg"] < 180,
        "density.bandwidths_deg (one or more, 0 or more)": len(config["density"]["bandwidths_deg"])
        > 0
        and min(config["density"]["bandwidths_deg"]) >= 0,
        "density.pseudo_observations (one or more, 0 or more)": len(
            config["density"]["pseudo_observations"]
        )
        > 0
        and min(config["density"]["pseudo_observations"]) >= 0,
        "recommendation.travel_cost (0 or more, in the criterion's unit per degree)": config[
            "recommendation"
        ]["travel_cost"]
        >= 0,
        "recommendation.max_travel_deg (0 to 180)": 0
        <= config["recommendation"]["max_travel_deg"]
        <= 180,
        "sequence.n_views (2 to 8)": 2 <= config["sequence"]["n_views"] <= 8,
        "sequence.start_every_deg (1 to 180)": 1 <= config["sequence"]["start_every_deg"] <= 180,
        "sequence.min_separation_deg (0 to 45)": 0
        <= config["sequence"]["min_separation_deg"]
        <= 45,
        "density.n_parts (2 or more)": config["density"]["n_parts"] >= 2,
        "crossfit_parts (2 or more)": config["crossfit_parts"] >= 2,
        "crossfit_epochs (1 or more; as many as null stands for need more estimator.epochs)": (
            config["crossfit_epochs"] is None or config["crossfit_epochs"] >= 1
        ),
    }
    estimator = config["estimator"]
    if estimator["kind"] == "classifier":
        _require(
            {"n_classes", "target_bandwidth_deg"} <= estimator.keys(),
            "estimator.kind=classifier: it needs n_classes and target_bandwidth_deg; choose "
            "estimator=classifier, which has them",
        )
        positive |= {
            "estimator.n_classes (8 or more, a divisor of 360)": (
                estimator["n_classes"] >= 8 and 360 % estimator["n_classes"] == 0
            ),
            "estimator.target_bandwidth_deg (above 0)": estimator["target_bandwidth_deg"] > 0,
        }
    for name, holds in positive.items():
        key, _, range_ = name.partition(" ")
        _require(holds, f"{key}={value_of(config, key)} is out of range: {range_.strip('()')}")
    for key, choices in CHOICES.items():
        value = value_of(config, key)
        _require(value in choices, f"{key}={value} is unknown: {nearest(value, choices)}")
    _require(len(config["categories"]) > 0, "categories=[] names no category")
    focus = config["focus_category"]
    _require(
        focus is None or focus in config["categories"],
        f"focus_category={focus} is no category of this run: "
        f"{nearest(str(focus), config['categories'])}",
    )
    known = config["elevations_deg"]
    for category in config["categories"]:
        _require(
            category in known,
            f"categories: {category!r} is unknown: {nearest(category, known)} "
            "(a new category also needs elevations_deg.<category>)",
        )
        for elevation in known[category]:
            _require(
                0 <= elevation < 90,
                f"elevations_deg.{category}: {elevation} is outside 0 to 89 degrees",
            )
        _require(len(known[category]) > 0, f"elevations_deg.{category}=[] names no elevation")
    _require(
        re.fullmatch(r"[A-Za-z0-9._-]+", config["name"]) is not None,
        f"name={config['name']}: use letters, digits, '.', '_' and '-'",
    )
    for category, diagonal_m in config["sensor"]["diagonal_m"].items():
        _require(
            diagonal_m > 0, f"sensor.diagonal_m.{category}={diagonal_m} is out of range: above 0"
        )
    _validate_transfer(config)
    for category in config["dataset"]["turn_deg"]:
        _require(
            category in known,
            f"dataset.turn_deg.{category}: no such category; {nearest(category, known)}",
        )


def _validate_transfer(config: Mapping[str, Any]) -> None:
    transfer = config["transfer"]
    category, folds = transfer["category"], transfer["folds"]
    _require(
        category is None or category in config["categories"],
        f"transfer.category={category} is no category of this run: "
        f"{nearest(str(category), config['categories'])}",
    )
    _require(
        0 <= transfer["elevation_deg"] < 90,
        f"transfer.elevation_deg={transfer['elevation_deg']} is outside 0 to 89 degrees",
    )
    _require(
        folds is None or (len(folds) > 0 and set(folds) <= set(range(1, config["n_folds"] + 1))),
        f"transfer.folds={folds} is out of range: one or more of 1 to n_folds={config['n_folds']}",
    )
    _require(len(transfer["conditions"]) > 0, "transfer.conditions={} names no condition")
    for name, condition in transfer["conditions"].items():
        key, framing = f"transfer.conditions.{name}", condition["framing"]
        _require(
            re.fullmatch(r"[A-Za-z0-9_-]+", name) is not None,
            f"{key}: use letters, digits, '_' and '-' in a condition's name",
        )
        choices = CHOICES["camera.framing"]
        _require(
            framing in choices, f"{key}.framing={framing} is unknown: {nearest(framing, choices)}"
        )

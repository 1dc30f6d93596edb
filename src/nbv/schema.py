"""What a configuration may hold: the keys, their types and their ranges."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nbv.amounts import enough_objects
from nbv.errors import UserError, nearest


@dataclass
class DatasetConfig:
    """Where meshes come from; see `nbv.meshes.sources`."""

    source: str
    root: str | None = None
    layout: str = "auto"
    categories: dict[str, str] = field(default_factory=dict)
    up: str = "+z"
    front: str = "+x"
    turn_deg: dict[str, float] = field(default_factory=dict)
    centre: str = "box"
    exclude: list[str] = field(default_factory=list)
    exclude_file: str | None = None


@dataclass
class RendererConfig:
    """Which renderer draws depth."""

    name: str


@dataclass
class CameraConfig:
    """The depth camera; see `nbv.rendering.camera`."""

    distance: float
    fov_deg: float
    image_side: int
    framing: str


@dataclass
class SensorConfig:
    """How the depth camera measures; see `nbv.rendering.sensors`."""

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    diagonal_m: dict[str, float] = field(default_factory=dict)


@dataclass
class EstimatorConfig:
    """The single-view estimator; see `nbv.estimation`."""

    kind: str
    channels: list[int]
    hidden: int
    epochs: int
    batch_size: int
    learning_rate: float
    weight_decay: float
    device: str
    precision: str


@dataclass
class DensityConfig:
    """The density of calibration pairs and how it is chosen; see `nbv.recommendation.selection`."""

    reading: str
    spread: str
    bandwidths_deg: list[float]
    pseudo_observations: list[float]
    n_parts: int


@dataclass
class RecommendationConfig:
    """What travelling costs; see `nbv.recommendation.lookup.least_ambiguous_delta`."""

    travel_cost: float
    max_travel_deg: float


@dataclass
class SequenceConfig:
    """More than two views; see `nbv.evaluation.sequences`."""

    n_views: int
    start_every_deg: int
    min_separation_deg: float


@dataclass
class MethodConfig:
    """A way to choose the second view and to fuse the two; see `nbv.evaluation.methods`."""

    rotation: str
    fusion: str = "average"


@dataclass
class ConditionConfig:
    """What sees the objects, and how they are framed."""

    sensor: str
    framing: str


@dataclass
class TransferConfig:
    """Conditions to train under and to test under; see `nbv.evaluation.transfer`."""

    category: str | None
    elevation_deg: int
    folds: list[int] | None
    conditions: dict[str, ConditionConfig]


@dataclass
class Config:
    """Everything a run depends on."""

    experiment: str
    name: str | None
    seed: int
    categories: list[str]
    focus_category: str | None
    elevations_deg: dict[str, list[int]]
    n_objects: int | None
    n_folds: int
    calibration_fraction: float
    methods: dict[str, MethodConfig]
    contenders: dict[str, MethodConfig]
    leaderboard_runs: list[str]
    n_resamples: int
    dataset: DatasetConfig
    renderer: RendererConfig
    camera: CameraConfig
    sensor: SensorConfig
    estimator: EstimatorConfig
    density: DensityConfig
    recommendation: RecommendationConfig
    sequence: SequenceConfig
    transfer: TransferConfig


# Names that belong to code rather than to a file of a configuration group.
CHOICES = {
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

"""What a configuration may hold: the keys, their types and their ranges."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any, get_type_hints

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
    """How the depth camera measures; see `nbv.rendering.sensor`."""

    name: str


@dataclass
class EstimatorConfig:
    """The single-view estimator; see `nbv.estimation`. Null stands for what a kind has not."""

    kind: str
    channels: list[int]
    hidden: int
    epochs: int
    batch_size: int
    learning_rate: float
    weight_decay: float
    device: str
    precision: str
    n_classes: int | None = None
    target_bandwidth_deg: float | None = None


@dataclass
class DensityConfig:
    """The density of calibration pairs and how it is chosen; see `nbv.recommendation.selection`."""

    reading: str
    spread: str
    bandwidths_deg: list[float]
    pseudo_observations: list[float]
    n_parts: int


@dataclass
class MethodConfig:
    """A way to choose the second view and to fuse the two; see `nbv.evaluation.methods`."""

    rotation: str
    fusion: str = "average"


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
    n_resamples: int
    dataset: DatasetConfig
    renderer: RendererConfig
    camera: CameraConfig
    sensor: SensorConfig
    estimator: EstimatorConfig
    density: DensityConfig
    calibration: str = "holdout"
    crossfit_parts: int = 2
    crossfit_epochs: int | None = None
    beside: list[str] = field(default_factory=list)


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


def enough_objects(n_objects: int, n_folds: int) -> bool:
    """Say whether each fold can test one object and has two more, to train and to calibrate."""
    largest = -(-n_objects // n_folds)
    return n_objects >= n_folds and n_objects - largest >= 2


def value_of(config: Mapping[str, Any], key: str) -> Any:
    """Return the value of a dotted key."""
    value: Any = config
    for part in key.split("."):
        value = value[part]
    return value


def default_of(key: str, otherwise: Any) -> Any:
    """Return what a dotted key stands at where a configuration, perhaps an older one, lacks it."""
    schema: Any = Config
    for part in key.split("."):
        found = [item for item in fields(schema) if item.name == part] if schema else []
        if not found:
            return otherwise
        last, hint = found[0], get_type_hints(schema)[part]
        schema = hint if is_dataclass(hint) else None
    if last.default_factory is not MISSING:
        return last.default_factory()
    return otherwise if last.default is MISSING else last.default


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
    for category in config["dataset"]["turn_deg"]:
        _require(
            category in known,
            f"dataset.turn_deg.{category}: no such category; {nearest(category, known)}",
        )

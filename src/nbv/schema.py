"""What a configuration may hold: the keys and their types; `nbv.validation` has the ranges."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any, get_type_hints


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
    """How the depth camera measures; see `nbv.rendering.noise`."""

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    diagonal_m: dict[str, float] = field(default_factory=dict)


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
    """The density of calibration pairs; see `nbv.recommendation.density_selection`."""

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
    """More than two views; see `nbv.experiments.more_views`."""

    n_views: int
    start_every_deg: int
    min_separation_deg: float


@dataclass
class MethodConfig:
    """A way to choose the second view and to fuse the two; see `nbv.experiments.two_views`."""

    rotation: str
    fusion: str = "average"


@dataclass
class ConditionConfig:
    """What sees the objects, and how they are framed."""

    sensor: str
    framing: str


@dataclass
class TransferConfig:
    """Conditions to train under and to test under; see `nbv.reporting.extensions.transfer`."""

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
    calibration: str = "holdout"
    crossfit_parts: int = 2
    crossfit_epochs: int | None = None
    beside: list[str] = field(default_factory=list)


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

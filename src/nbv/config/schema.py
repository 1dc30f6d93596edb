"""What a configuration may hold: every key, type, range and choice, and what names must agree."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from nbv.errors import UserError, nearest
from nbv.fold_sizes import enough_objects

Whole = Annotated[int, Field(strict=True)]
Number = Annotated[float, Field(strict=True)]
Count = Annotated[Whole, Field(ge=1)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Elevation = Annotated[Whole, Field(ge=0, le=89)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$")]
Framing = Literal["silhouette", "axis"]

RENAMED_KEYS = {
    "contenders": "extensions",
    "beside": "compared_runs",
    "sequence": "more_views",
    "reading": "pose_likelihood",
    "rotation": "policy",
}
"""New names of earlier keys, in sections that have the new key and not the earlier one."""

RENAMED_VALUES = {
    "policy": {"entropy": "pose_ambiguity", "chosen": "selected"},
    "fusion": {"chosen": "selected"},
}
"""New names of earlier values, by their key."""


class Section(BaseModel):
    """Keys that belong together. Another key is a mistake."""

    # So that a name of digits needs no quotes.
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, coerce_numbers_to_str=True)


class Dataset(Section):
    """Where meshes come from; see `nbv.meshes.sources`."""

    source: str
    root: str | None = None
    layout: str = "auto"
    categories: dict[str, str] = {}
    up: str = "+z"
    front: str = "+x"
    turn_deg: dict[str, Number] = {}
    centre: Literal["box", "origin"] = "box"
    exclude: list[str] = []
    exclude_file: str | None = None


class Renderer(Section):
    """Which renderer draws depth; see `nbv.rendering`."""

    name: str


class Camera(Section):
    """The depth camera; see `nbv.rendering.camera`."""

    distance: Annotated[Number, Field(gt=1), "in object diagonals"]
    fov_deg: Annotated[Number, Field(gt=0, lt=180)]
    image_side: Annotated[Whole, Field(ge=8)]
    framing: Framing


class Sensor(Section):
    """How the depth camera measures; see `nbv.rendering.noise`."""

    name: str
    parameters: dict[str, Number] = {}
    diagonal_m: dict[str, Positive] = {}


class Estimator(Section):
    """The single-view estimator; see `nbv.estimation`. A kind omits what it does not have."""

    kind: str
    channels: Annotated[list[Count], Field(min_length=1)]
    hidden: Count
    epochs: Count
    batch_size: Annotated[Whole, Field(ge=2)]
    learning_rate: Positive
    weight_decay: NotNegative
    device: Literal["auto", "cpu", "cuda", "mps"]
    precision: Literal["auto", "bfloat16", "float32"]
    n_classes: Annotated[Whole, Field(ge=8), "a divisor of 360"] | None = None
    target_bandwidth_deg: Positive | None = None

    @model_validator(mode="after")
    def _check_classes(self) -> Self:
        absent = self.n_classes is None, self.target_bandwidth_deg is None
        if any(absent) if self.kind == "classifier" else not all(absent):
            raise UserError(
                f"estimator.kind={self.kind}: only a classifier has n_classes and "
                "target_bandwidth_deg, and it needs both; choose estimator=classifier"
            )
        if self.n_classes is not None and 360 % self.n_classes:
            raise UserError(f"estimator.n_classes={self.n_classes} is no divisor of 360")
        return self


class Density(Section):
    """The density of calibration pairs; see `nbv.recommendation.density_selection`."""

    pose_likelihood: Literal["given_estimate", "given_truth"]
    spread: Literal["entropy", "circular_variance"]
    bandwidths_deg: Annotated[list[NotNegative], Field(min_length=1)]
    pseudo_observations: Annotated[list[NotNegative], Field(min_length=1)]
    n_parts: Annotated[Whole, Field(ge=2)]


class Recommendation(Section):
    """What travel costs; see `nbv.recommendation.lookup.least_cost_delta`."""

    travel_cost: Annotated[NotNegative, "in the criterion's unit per degree"]
    max_travel_deg: Annotated[Number, Field(ge=0, le=180)]


class MoreViews(Section):
    """More than two views; see `nbv.experiments.more_views`."""

    n_views: Annotated[Whole, Field(ge=2, le=8)]
    start_every_deg: Annotated[Whole, Field(ge=1, le=180)]
    min_separation_deg: Annotated[Number, Field(ge=0, le=45)]


class Method(Section):
    """A policy with a fusion; `nbv.recommendation` knows their names."""

    policy: str
    fusion: str = "average"

    @field_validator("policy", "fusion")
    @classmethod
    def _check_name_is_new(cls, value: str, info: ValidationInfo) -> str:
        key = str(info.field_name)
        if value in RENAMED_VALUES[key]:
            raise ValueError(f"{key} {value!r} is now {RENAMED_VALUES[key][value]!r}")
        return value


class Condition(Section):
    """What sees the objects, and how they are framed."""

    sensor: str
    framing: Framing


class Transfer(Section):
    """Conditions to train under and to test under; see `nbv.reporting.extensions.transfer`."""

    category: str | None
    elevation_deg: Elevation
    folds: Annotated[list[Whole], Field(min_length=1)] | None
    conditions: Annotated[dict[Name, Condition], Field(min_length=1)]


class Config(Section):
    """Everything a run depends on."""

    experiment: Name
    name: Name | None
    seed: Annotated[Whole, Field(ge=0)]
    categories: Annotated[list[str], Field(min_length=1)]
    focus_category: str | None
    elevations_deg: dict[str, Annotated[list[Elevation], Field(min_length=1)]]
    n_objects: Whole | None
    n_folds: Annotated[Whole, Field(ge=2)]
    calibration: Literal["holdout", "crossfit"] = "holdout"
    calibration_fraction: Annotated[Number, Field(gt=0, lt=1)]
    crossfit_parts: Annotated[Whole, Field(ge=2)] = 2
    crossfit_epochs: Count | None = None
    methods: dict[Name, Method]
    extensions: dict[Name, Method]
    compared_runs: list[str] = []
    leaderboard_runs: list[str]
    n_resamples: Annotated[Whole, Field(ge=100)]
    dataset: Dataset
    renderer: Renderer
    camera: Camera
    sensor: Sensor
    estimator: Estimator
    density: Density
    recommendation: Recommendation
    more_views: MoreViews
    transfer: Transfer

    @model_validator(mode="after")
    def _check_categories(self) -> Self:
        known, ours = self.elevations_deg, self.categories
        for category in ours:
            if category not in known:
                raise UserError(
                    f"categories: {category!r} is unknown: {nearest(category, known)} "
                    "(a new category also needs elevations_deg.<category>)"
                )
        focus = {"focus_category": self.focus_category, "transfer.category": self.transfer.category}
        for key, named in focus.items():
            if named is not None and named not in ours:
                raise UserError(f"{key}={named} is no category of this run: {nearest(named, ours)}")
        for turned in self.dataset.turn_deg:
            if turned not in known:
                raise UserError(
                    f"dataset.turn_deg.{turned}: no such category; {nearest(turned, known)}"
                )
        return self

    @model_validator(mode="after")
    def _check_folds(self) -> Self:
        if self.n_objects is not None and not enough_objects(self.n_objects, self.n_folds):
            raise UserError(
                f"n_objects={self.n_objects} is out of range: enough to train, calibrate and test "
                "in each of n_folds, or null for all"
            )
        folds = self.transfer.folds or []
        if not set(folds) <= set(range(1, self.n_folds + 1)):
            raise UserError(f"transfer.folds={folds} is out of range: 1 to n_folds={self.n_folds}")
        return self

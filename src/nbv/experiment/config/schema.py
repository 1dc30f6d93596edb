"""The schema of a configuration: keys, types, ranges, choices, and constraints between keys."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from nbv.core.circle.selection import AFFINITY
from nbv.core.seeds import FIRST_FEATURE_SEED
from nbv.errors import UserError, nearest
from nbv.experiment.splits import enough_objects

T = TypeVar("T")

NAME_RULE = "use letters, digits, '.', '_' and '-', a letter or digit first, 100 at most"
"""The rule for names that become a part of a path or a wildcard of Snakemake."""


def _distinct(values: list[T]) -> list[T]:
    for index, value in enumerate(values):
        if value in values[:index]:
            raise ValueError(f"{value} occurs twice")
    return values


def _any(replicates: list[list[int]]) -> list[list[int]]:
    if not any(replicates):
        raise ValueError("no replicate under any shuffle")
    return replicates


def _below_root(folder: str) -> str:
    path = PurePosixPath(folder)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError("not below dataset.root")
    return folder


def _with_known_home(path: str) -> str:
    try:
        Path(path).expanduser()
    except RuntimeError:
        raise ValueError("unknown user") from None
    return path


def _matches(pattern: str, rule: str) -> AfterValidator:
    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(rule)
        return text

    return AfterValidator(check)


Whole = Annotated[int, Field(strict=True)]
Number = Annotated[float, Field(strict=True)]
# Far above any use, and small enough for arithmetic.
Count = Annotated[Whole, Field(ge=1, le=10**12)]
Epochs = Annotated[Whole, Field(ge=1, le=10**6)]
LearningRate = Annotated[Number, Field(gt=0, le=10)]
Angle = Annotated[Number, Field(ge=-360, le=360)]
Bandwidth = Annotated[Number, Field(ge=0, le=180)]
PseudoObservations = Annotated[Number, Field(ge=0, le=10**9)]
Share = Annotated[Number, Field(ge=0, le=1)]
Diagonals = Annotated[Number, Field(gt=1, le=1000)]  # a distance
Replicate = Annotated[Whole, Field(ge=0, le=999)]
Elevation = Annotated[Whole, Field(ge=0, le=89)]
Name = Annotated[str, _matches(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", NAME_RULE)]
Text = Annotated[str, _matches(r"[^\x00-\x1f\x7f]{1,4096}", "use one line of text")]
DataPath = Annotated[Text, AfterValidator(_with_known_home)]
_AXIS = r"auto|[+-]?[xyzXYZ]|[^,\s]+(,[^,\s]+){2}"
Axis = Annotated[str, _matches(_AXIS, "use an axis such as +y, a vector such as 0,0,1, or auto")]
Distinct = AfterValidator(_distinct)
AtLeastOne = Field(min_length=1, max_length=100)
Framing = Literal["silhouette", "axis"]

FEWEST_PIXELS = 4
"""The least diagonal of an object in an image; fewer pixels do not show the viewpoint."""


class Section(BaseModel):
    """Keys that belong together. Any other key is an error."""

    # So that a name of digits needs no quotes.
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, coerce_numbers_to_str=True)


class Dataset(Section):
    """Where meshes come from; see `nbv.data.sources`."""

    source: str
    root: DataPath | None = None
    layout: Literal["auto", "v1", "v2", "sem"] = "auto"
    categories: dict[Name, Annotated[Text, AfterValidator(_below_root)]] = {}
    up: Axis = "+z"
    front: Axis = "+x"
    turn_deg: dict[Name, Angle] = {}
    centre: Literal["box", "origin"] = "box"
    handle_reach: Annotated[Number, Field(ge=0, le=0.5)] = 0.0  # widths of a mug's body
    square_share: Share = 0.0
    exclude: list[Text] = []
    exclude_file: DataPath | None = None

    @model_validator(mode="after")
    def _clear_settings_of_procedural_mugs(self) -> Self:
        # An experiment sets them for any data set, but a run must record what applies to it.
        if self.source != "procedural":
            self.handle_reach = self.square_share = 0.0
        return self


class Renderer(Section):
    """Which renderer draws depth; see `nbv.data.render`."""

    name: str


class Camera(Section):
    """The depth camera; see `nbv.data.camera`."""

    distance: Diagonals
    fov_deg: Annotated[Number, Field(ge=0.05, le=160)]
    image_side: Annotated[Whole, Field(ge=8, le=10**6)]
    framing: Framing

    @model_validator(mode="after")
    def _check_object_size(self) -> Self:
        width = 2 * self.distance * math.tan(math.radians(self.fov_deg) / 2)
        if self.image_side / width < FEWEST_PIXELS:
            raise UserError(
                f"camera.distance={self.distance:g} with camera.fov_deg={self.fov_deg:g} and "
                f"camera.image_side={self.image_side} shows an object {self.image_side / width:.2g}"
                f" pixels wide, and it needs {FEWEST_PIXELS}: bring the camera nearer, narrow its "
                "view or take more pixels"
            )
        return self


class Sensor(Section):
    """How the depth camera measures; see `nbv.data.sensors`."""

    name: str
    parameters: dict[Name, Annotated[Number, Field(gt=0, le=10**6)]] = {}
    diagonal_m: dict[Name, Annotated[Number, Field(gt=0, le=1000)]] = {}


class Schedule(Section):
    """Epochs and peak rate of a stage of training; see `nbv.experiment.stages`."""

    epochs: Epochs
    learning_rate: LearningRate


LINEAR = ("linear", "linear_classifier")
"""Estimators on depth features, which are not trained; see `nbv.experiment.estimation.linear`."""

_OUTPUT_KEYS = ("kind", "mirror_images", "n_classes", "target_bandwidth_deg", "pairs")


class Estimator(Section):
    """The single-view estimator; each kind has only the keys that it uses."""

    kind: str
    channels: Annotated[list[Count], AtLeastOne] | None = None
    hidden: Count | None = None
    epochs: Epochs | None = None
    batch_size: Annotated[Whole, Field(ge=2, le=10**12)] | None = None
    learning_rate: LearningRate | None = None
    weight_decay: Annotated[Number, Field(ge=0, le=10)] | None = None
    device: Literal["auto", "cpu", "cuda", "mps"] | None = None
    precision: Literal["auto", "bfloat16", "float32"] | None = None
    warm_start: Literal["none", "elevations", "categories", "both", "features"] | None = "none"
    pretraining: Schedule | None = Schedule(epochs=2, learning_rate=9e-3)
    fine_tuning: Schedule | None = Schedule(epochs=5, learning_rate=4e-3)
    next_elevation: Schedule | None = Schedule(epochs=4, learning_rate=4e-3)
    mirror_images: bool = False
    n_classes: Annotated[Whole, Field(ge=8, le=360)] | None = None
    target_bandwidth_deg: Annotated[Number, Field(ge=0.1, le=180)] | None = None
    pairs: str | None = None

    @model_validator(mode="after")
    def _check_training(self) -> Self:
        trained = [name for name in type(self).model_fields if name not in _OUTPUT_KEYS]
        if self.kind in LINEAR:
            # An experiment sets them for any estimator, but a run must record what applies to it.
            for name in trained:
                setattr(self, name, None)
        elif missing := [name for name in trained if getattr(self, name) is None]:
            raise UserError(f"estimator.{missing[0]} is missing: estimator={self.kind} is trained")
        return self

    @model_validator(mode="after")
    def _check_pairs(self) -> Self:
        is_external = self.kind in ("external", "external_distributions")
        if is_external != (self.pairs is not None):
            raise UserError(
                f"estimator.kind={self.kind} and estimator.pairs={self.pairs}: an external "
                "estimator needs a file of calibration pairs, and no other has one; choose "
                "estimator=external, or external_distributions, with estimator.pairs=<file>"
            )
        return self

    @model_validator(mode="after")
    def _check_classes(self) -> Self:
        has = self.n_classes is not None, self.target_bandwidth_deg is not None
        needs = dict.fromkeys(("classifier", "linear_classifier"), (True, True))
        needs["external_distributions"] = True, False
        if has != needs.get(self.kind, (False, False)):
            raise UserError(
                f"estimator.kind={self.kind}: a classifier has n_classes and target_bandwidth_deg, "
                "and it needs both; external_distributions needs n_classes alone; no other "
                "estimator has either: choose estimator=classifier"
            )
        if self.n_classes is not None and (360 % self.n_classes or self.n_classes % 2):
            raise UserError(
                f"estimator.n_classes={self.n_classes} is not an even divisor of 360: the opposite "
                "view needs a class"
            )
        return self


class Density(Section):
    """The density of calibration pairs; see `nbv.core.circle.selection`."""

    pose_likelihood: Literal["given_estimate", "given_truth", "through_estimate"]
    spread: Literal["entropy", "circular_variance"]
    bandwidths_deg: Annotated[list[Bandwidth], AtLeastOne, Distinct]
    pseudo_observations: Annotated[list[PseudoObservations], AtLeastOne, Distinct]
    n_parts: Annotated[Whole, Field(ge=2, le=1000)]


class Affinity(Section):
    """How similar two distributions must be to count; see `nbv.core.circle.criteria`."""

    power: Annotated[Number, Field(gt=0, le=10**4)] = AFFINITY["power"]
    pseudo_observations: PseudoObservations = AFFINITY["pseudo_observations"]


class Recommendation(Section):
    """The cost of travel; see `nbv.core.circle.lookup.least_cost_delta`."""

    travel_cost: Annotated[Number, Field(ge=0, le=10**6)]  # the criterion's unit per degree
    max_travel_deg: Annotated[Number, Field(ge=0, le=180)]


class MoreViews(Section):
    """More than two views; see `studies.curves`."""

    n_views: Annotated[Whole, Field(ge=2, le=8)]
    start_every_deg: Annotated[Whole, Field(ge=1, le=180)]
    min_separation_deg: Annotated[Number, Field(ge=0, le=45)]


class Method(Section):
    """A policy with a fusion; `nbv.core` knows their names."""

    policy: str
    fusion: str = "average"


class Confirmation(Section):
    """Trainings beyond the run's own; see `studies.confirmation`."""

    dataset: Name | None = None
    replicates: Annotated[
        list[Annotated[list[Replicate], Distinct]], AtLeastOne, AfterValidator(_any)
    ] = [[0]]
    kept: Annotated[list[DataPath], Distinct] = []


class Condition(Section):
    """The sensor that sees the objects, and their framing."""

    sensor: str
    framing: Framing


class Randomisation(Section):
    """Ranges of unknown camera conditions; see `nbv.data.randomisation`."""

    elevation_deg: Annotated[Number, Field(ge=0, le=85)] = 0.0
    roll_deg: Annotated[Number, Field(ge=0, le=180)] = 0.0
    size: Annotated[Number, Field(ge=0, le=0.9)] = 0.0
    nearest: Diagonals | None = None
    farthest: Diagonals | None = None
    focal: Annotated[Number, Field(ge=0, le=0.9)] = 0.0
    measured: Share = 1.0
    table: Share = 0.0
    cutout: Share = 0.0
    thin: Share = 0.0
    split: Share = 0.0
    inside: Share = 0.0
    hole: Share = 0.0
    occluded: Share = 0.0
    patches: Annotated[Number, Field(ge=0, le=100)] = 0.0
    edge_px: Annotated[Number, Field(ge=0, le=100)] = 0.0
    shift_px: Annotated[Number, Field(ge=0, le=100)] = 0.0

    @model_validator(mode="after")
    def _check_distances(self) -> Self:
        if (self.nearest is None) != (self.farthest is None):
            raise UserError("randomisation.nearest and randomisation.farthest belong together")
        if self.nearest is not None and self.farthest is not None and self.farthest < self.nearest:
            raise UserError(
                f"randomisation.farthest={self.farthest:g} is less than nearest={self.nearest:g}"
            )
        return self


class Bundles(Section):
    """Calibration sweeps of bundles, the ingredients they are compared without, and the frames."""

    calibration_turns: Annotated[int, Field(ge=1)] = 360
    ingredients: dict[Name, dict[Name, Number | None]] = {}
    replicates: Annotated[list[Replicate], Field(min_length=1), Distinct] = [0]
    frames: str | None = None

    @model_validator(mode="after")
    def _check_ingredients(self) -> Self:
        for name, left_out in self.ingredients.items():
            for key in left_out:
                if key not in Randomisation.model_fields:
                    raise UserError(
                        f"bundles.ingredients.{name}.{key} is unknown: "
                        f"{nearest(key, Randomisation.model_fields)}"
                    )
        return self


class Transfer(Section):
    """Conditions for training and testing; see `studies.transfer`."""

    category: Name | None
    elevation_deg: Elevation
    folds: Annotated[list[Whole], Field(min_length=1), Distinct] | None
    conditions: Annotated[dict[Name, Condition], AtLeastOne]


class Rotations(Section):
    """Answers of an estimator in three dimensions; see `studies.rotations`."""

    pairs: DataPath | None = None
    models_info: DataPath | None = None
    objects: Annotated[list[Text], Distinct] = []
    score_objects: Annotated[list[Text], Distinct] = []
    judged_folds: Annotated[list[Whole], Distinct] = []
    draws: Annotated[Whole, Field(ge=1, le=1000)] = 1
    turns: Annotated[Whole, Field(ge=2, le=10_000)] = 16
    views: Annotated[Whole, Field(ge=1, le=360)] = 24
    poses: Annotated[Whole, Field(ge=24, le=100_000)] = 4608


class Config(Section):
    """Everything a run depends on."""

    experiment: Name
    name: Name | None
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)]
    categories: Annotated[list[Name], Field(min_length=1), Distinct]
    focus_category: Name | None
    elevations_deg: dict[Name, Annotated[list[Elevation], Field(min_length=1), Distinct]]
    n_objects: Annotated[Whole, Field(ge=3, le=10**12)] | None
    n_folds: Annotated[Whole, Field(ge=2, le=1000)]
    calibration: Literal["holdout", "crossfit"] = "holdout"
    calibration_fraction: Annotated[Number, Field(gt=0, lt=1)]
    crossfit_parts: Annotated[Whole, Field(ge=2, le=100)] = 2
    crossfit_epochs: Epochs | None = None
    methods: Annotated[dict[Name, Method], AtLeastOne]
    extensions: dict[Name, Method]
    compared_runs: list[Name] = []
    leaderboard_runs: Annotated[list[Name], Distinct]
    n_resamples: Annotated[Whole, Field(ge=100, le=10**12)]
    dataset: Dataset
    renderer: Renderer
    camera: Camera
    mirror_plane_deg: dict[Name, Annotated[Number, Field(ge=0, lt=180, multiple_of=0.5)]] = {}
    sensor: Sensor
    estimator: Estimator
    density: Density
    affinity: Affinity = Affinity()
    recommendation: Recommendation
    more_views: MoreViews
    transfer: Transfer
    confirmation: Confirmation = Confirmation()
    randomisation: Randomisation = Randomisation()
    bundles: Bundles = Bundles()
    rotations: Rotations = Rotations()

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
                raise UserError(
                    f"{key}={named} is not a category of this run: {nearest(named, ours)}"
                )
        by_category: dict[str, Collection[str]] = {
            "dataset.turn_deg": self.dataset.turn_deg,
            "dataset.categories": self.dataset.categories,
            "mirror_plane_deg": self.mirror_plane_deg,
            "sensor.diagonal_m": self.sensor.diagonal_m,
        }
        for key, values in by_category.items():
            for named in values:
                if named not in known:
                    raise UserError(
                        f"{key}.{named}: elevations_deg has no {named}; {nearest(named, known)}"
                    )
        return self

    @model_validator(mode="after")
    def _check_seed(self) -> Self:
        uses_features = self.estimator.kind in LINEAR or self.estimator.warm_start == "features"
        is_features = self.experiment == "features" and not uses_features
        if self.seed >= FIRST_FEATURE_SEED and not is_features:
            raise UserError(
                f"seed={self.seed}: the depth features have seen objects of the seeds from "
                f"{FIRST_FEATURE_SEED} on; give a smaller one"
            )
        return self

    @model_validator(mode="after")
    def _check_folds(self) -> Self:
        if self.n_objects is not None and not enough_objects(self.n_objects, self.n_folds):
            raise UserError(
                f"n_objects={self.n_objects} is out of range: enough to train, calibrate and test "
                "in each of n_folds, or null for all"
            )
        judged = {"transfer.folds": self.transfer.folds or []}
        judged["rotations.judged_folds"] = self.rotations.judged_folds
        for key, folds in judged.items():
            if not set(folds) <= set(range(1, self.n_folds + 1)):
                raise UserError(f"{key}={folds} is out of range: 1 to n_folds={self.n_folds}")
        return self

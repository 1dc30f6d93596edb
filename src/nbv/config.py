"""The configuration: one Hydra tree, validated against dataclasses, handed on as plain dicts."""

from __future__ import annotations

import dataclasses
import re
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nbv.errors import UserError, nearest

GROUPS = ("experiment", "dataset", "renderer", "sensor", "estimator", "density")


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
    focus_category: str
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


def _dataclass_of(annotation: Any) -> type | None:
    return annotation if dataclasses.is_dataclass(annotation) else None  # type: ignore[return-value]


def _check_key(key: str) -> None:
    """Raise UserError for a dotted key that the schema does not have."""
    schema: type | None = Config
    for depth, part in enumerate(parts := key.split(".")):
        if schema is None:
            return  # below a dict or a list: its keys are data
        hints = typing.get_type_hints(schema)
        if part not in hints:
            meant = [".".join([*parts[:depth], name]) for name in hints]
            written = ".".join(parts[: depth + 1])
            raise UserError(f"configuration key {written!r} is unknown: {nearest(written, meant)}")
        schema = _dataclass_of(hints[part])


def _check_choice(directory: Path, group: str, choice: str) -> None:
    choices = [path.stem for path in (directory / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{group}={choice} is unknown: {nearest(choice, choices)}")


def _check_override(directory: Path, override: str) -> None:
    key, separator, value = override.partition("=")
    bare = key.lstrip("+~")
    if not separator and not key.startswith("~"):
        raise UserError(f"override {override!r} is not of the form key=value")
    if bare in GROUPS:
        _check_choice(directory, bare, value)
    else:
        _check_key(bare)


def load_config(directory: str | Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Compose, validate and resolve the configuration.

    Parameters
    ----------
    directory : path
        The folder that holds ``config.yaml`` and the groups.
    overrides : sequence of str
        Hydra overrides such as ``experiment=quick`` or ``estimator.epochs=4``.

    Returns
    -------
    dict
        Plain Python values only, keys in the order of the dataclasses: what Snakemake can compare.

    Raises
    ------
    UserError
        One line that names the key, the value and the nearest valid name.
    """
    from hydra import compose, initialize_config_dir
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    folder = Path(directory).resolve()
    for override in overrides:
        _check_override(folder, override)
    try:
        with initialize_config_dir(str(folder), version_base="1.3"):
            composed = compose("config", overrides=list(overrides))
        typed = OmegaConf.merge(OmegaConf.structured(Config), composed)
        plain = OmegaConf.to_container(typed, resolve=True, throw_on_missing=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(_one_line(error)) from error
    assert isinstance(plain, dict)
    settings = typing.cast(dict[str, Any], plain)
    if settings["name"] is None:
        source = settings["dataset"]["source"]
        suffix = "" if source == "procedural" else f"-{source}"
        settings["name"] = settings["experiment"] + suffix
    validate(settings)
    return settings


def _one_line(error: Exception) -> str:
    full_key = getattr(error, "full_key", None)
    text = re.split(r"\n", str(error).strip())[0]
    return f"configuration key {full_key!r}: {text}" if full_key else f"configuration: {text}"


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise UserError(message)


def validate(config: Mapping[str, Any]) -> None:
    """Check values that types cannot: ranges and names.

    Raises
    ------
    UserError
        One line that names the key.
    """
    positive = {
        "n_folds (2 or more)": config["n_folds"] >= 2,
        "n_objects (3 or more, or null for all there are)": config["n_objects"] is None
        or config["n_objects"] >= 3,
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
    }
    for name, holds in positive.items():
        key, _, range_ = name.partition(" ")
        value: Any = config
        for part in key.split("."):
            value = value[part]
        _require(holds, f"{key}={value} is out of range: {range_.strip('()')}")
    _require(len(config["categories"]) > 0, "categories=[] names no category")
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


def snakemake_overrides(given: Mapping[str, Any]) -> list[str]:
    """Turn what came with Snakemake's ``--config`` into Hydra overrides.

    Parameters
    ----------
    given : mapping
        ``key=value`` pairs such as ``experiment=quick``, and ``overrides``, a list (or one string)
        of Hydra overrides for keys that Snakemake's command line cannot spell.

    Raises
    ------
    UserError
        For a value that is neither text nor a number.
    """
    overrides = []
    for key, value in given.items():
        if key == "overrides":
            continue
        if not isinstance(value, str | int | float) and value is not None:
            raise UserError(f'--config {key}: write it as overrides="[{key}=...]"')
        overrides.append(f"{key}={'null' if value is None else value}")
    extra = given.get("overrides") or []
    return overrides + (_items(extra) if isinstance(extra, str) else [str(item) for item in extra])


def _items(text: str) -> list[str]:
    """Split ``[a=1,b=[2,3]]`` or ``a=1,b=[2,3]`` at the commas that no bracket encloses.

    Snakemake hands over as text what YAML cannot read, such as a list within an item.
    """
    inner = text[1:-1] if text.startswith("[") and text.endswith("]") else text
    items, depth = [""], 0
    for character in inner:
        depth += (character in "[{(") - (character in "]})")
        if character == "," and depth == 0:
            items.append("")
        else:
            items[-1] += character
    return [item.strip() for item in items if item.strip()]

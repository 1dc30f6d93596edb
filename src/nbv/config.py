"""The configuration: one Hydra tree, validated against dataclasses, handed on as plain dicts."""

from __future__ import annotations

import dataclasses
import re
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nbv.errors import UserError, nearest
from nbv.files import existing
from nbv.schema import Config
from nbv.validation import validate

# The key of each group that names what its files configure: valid are the names they hold.
_NAMING_KEYS = {
    "dataset": "source",
    "renderer": "name",
    "sensor": "name",
    "estimator": "kind",
}
GROUPS = ("experiment", "dataset", "renderer", "sensor", "estimator", "density")


def _dataclass_of(annotation: Any) -> type | None:
    return annotation if dataclasses.is_dataclass(annotation) else None  # type: ignore[return-value]


def _check_key(key: str) -> Any:
    """Return a dotted key's type, None below a dict; raise UserError for an unknown key."""
    schema: type | None = Config
    annotation: Any = Config
    for depth, part in enumerate(parts := key.split(".")):
        if schema is None:
            return None  # its keys are data
        hints = typing.get_type_hints(schema)
        if part not in hints:
            meant = [".".join([*parts[:depth], name]) for name in hints]
            written = ".".join(parts[: depth + 1])
            raise UserError(f"configuration key {written!r} is unknown: {nearest(written, meant)}")
        annotation = hints[part]
        schema = _dataclass_of(annotation)
    return annotation


def _check_choice(directory: Path, group: str, choice: str, key: str | None = None) -> None:
    choices = [path.stem for path in (directory / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{key or group}={choice} is unknown: {nearest(choice, choices)}")


def _checked(directory: Path, override: str) -> str:
    """Return an override as Hydra takes it, after checking its key and its choice."""
    key, separator, value = override.partition("=")
    bare = key.lstrip("+~")
    if not separator and not key.startswith("~"):
        raise UserError(f"override {override!r} is not of the form key=value")
    if bare in GROUPS:
        _check_choice(directory, bare, value)
        return override
    annotation = _check_key(bare)
    if annotation in (str, str | None) and value not in ("null", "") and value[0] not in "'\"":
        # Quoted, for Hydra's grammar has no place for ~, = or brackets in plain text.
        escaped = value.replace("'", "\\'")
        override = f"{key}='{escaped}'"
    below_dict = annotation is None or typing.get_origin(annotation) is dict
    # What is data may have new keys, which Hydra calls adding and otherwise refuses.
    return f"++{override}" if below_dict and key == bare else override


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
    checked = [_checked(folder, override) for override in overrides]
    try:
        with initialize_config_dir(str(folder), version_base="1.3"):
            composed = compose("config", overrides=checked)
        typed = OmegaConf.merge(OmegaConf.structured(Config), composed)
        plain = OmegaConf.to_container(typed, resolve=True, throw_on_missing=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(_one_line(error)) from error
    assert isinstance(plain, dict)
    settings = typing.cast(dict[str, Any], plain)
    # So that a key of one kind of estimator is no setting of another.
    estimator = {key: value for key, value in settings["estimator"].items() if value is not None}
    settings["estimator"] = estimator
    if settings["name"] is None:
        settings["name"] = _name(settings)
    _check_names(folder, settings)
    if settings["calibration"] == "crossfit" and settings["crossfit_epochs"] is None:
        settings["crossfit_epochs"] = equal_cost_epochs(
            estimator["epochs"], settings["calibration_fraction"], settings["crossfit_parts"]
        )
    validate(settings)
    return settings


def _name(settings: Mapping[str, Any]) -> str:
    """Return the experiment's name and what sets a run apart from the experiment's own."""
    apart = {
        settings["dataset"]["source"]: "procedural",
        settings["estimator"]["kind"]: "regressor",
        settings["calibration"]: "holdout",
    }
    return "-".join([settings["experiment"], *(name for name, own in apart.items() if name != own)])


def equal_cost_epochs(epochs: int, calibration_fraction: float, parts: int) -> int:
    """Return the epochs of cross-fitting that see as many images as the hold-out does, or fewer.

    Of n objects that are not tested, the hold-out trains on (1 - f) n. Cross-fitting trains k
    estimators on (1 - 1/k) n and one on n, which is k n in every epoch.

    Parameters
    ----------
    epochs : int
        Of the hold-out.
    calibration_fraction : float
        f.
    parts : int
        k.

    Returns
    -------
    int
        The largest whole number e with e k <= epochs (1 - f); 0 where a single epoch is too much.
    """
    # Rounded first, for 10 * (1 - 0.4) / 2 falls short of 3.
    return int(round(epochs * (1.0 - calibration_fraction) / parts, 9))


def _check_names(directory: Path, settings: Mapping[str, Any]) -> None:
    from omegaconf import OmegaConf

    for group, key in _NAMING_KEYS.items():
        value = settings[group][key]
        files = (directory / group).glob("*.yaml")
        valid = [str(OmegaConf.select(OmegaConf.load(path), key)) for path in files]
        if value not in valid:
            raise UserError(f"{group}.{key}={value} is unknown: {nearest(value, valid)}")
    for name, condition in settings["transfer"]["conditions"].items():
        key = f"transfer.conditions.{name}.sensor"
        _check_choice(directory, "sensor", condition["sensor"], key)


def load_condition(
    directory: str | Path,
    overrides: Sequence[str],
    run: Mapping[str, Any],
    condition: Mapping[str, str],
) -> dict[str, Any]:
    """Return a run's configuration with the sensor and the framing of another condition.

    Parameters
    ----------
    directory, overrides
        What the run was composed of; see `load_config`.
    run : mapping
        Its configuration.
    condition : mapping
        ``sensor`` and ``framing``, from ``transfer.conditions``.

    Returns
    -------
    dict
        As from `load_config`. The run's overrides hold here too, but its sensor's parameters are
        no other sensor's.
    """
    replaced = r"sensor|camera\.framing"
    if condition["sensor"] != run["sensor"]["name"]:
        replaced += r"|sensor\.parameters.*"
    kept = [o for o in overrides if not re.fullmatch(replaced, o.partition("=")[0].lstrip("+~"))]
    chosen = [f"sensor={condition['sensor']}", f"camera.framing={condition['framing']}"]
    return load_config(directory, [*kept, *chosen])


def _one_line(error: Exception) -> str:
    full_key = getattr(error, "full_key", None)
    text = re.split(r"\n", str(error).strip())[0]
    return f"configuration key {full_key!r}: {text}" if full_key else f"configuration: {text}"


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
    return overrides + _items(extra if isinstance(extra, str) else ",".join(map(str, extra)))


def _items(text: str) -> list[str]:
    """Split ``[a=1,b=[2,3]]`` or ``a=1,b='2,3'`` at commas outside brackets and quotes.

    Snakemake hands over as text what YAML cannot read, such as a list within an item, and as a
    list that is cut at every comma what YAML can.
    """
    inner = text[1:-1] if text.startswith("[") and text.endswith("]") else text
    items, depth, quote = [""], 0, ""
    for character in inner:
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        else:
            depth += (character in "[{(") - (character in "]})")
        if character == "," and depth == 0 and not quote:
            items.append("")
        else:
            items[-1] += character
    return [item.strip() for item in items if item.strip()]


def read_configuration(root: Path) -> dict[str, Any]:
    """Read ``configuration.yaml`` of a run or reference as plain values.

    Raises
    ------
    UserError
        If it is missing, not a mapping, or does not say how many folds there are.
    """
    from omegaconf import OmegaConf

    path = existing(root / "configuration.yaml")
    configuration = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
    if not isinstance(configuration, dict):
        raise UserError(f"{path}: holds no settings; make it again")
    if not isinstance(configuration.get("n_folds"), int) or configuration["n_folds"] < 2:
        raise UserError(f"{path}: n_folds has to be 2 or more")
    return {str(key): value for key, value in configuration.items()}

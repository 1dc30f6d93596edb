"""A configuration as one plain dict: composed and checked, or read from a finished run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nbv.config.keys import one_line, type_of, with_new_names
from nbv.config.schema import Config
from nbv.errors import UserError, nearest
from nbv.files import existing

GROUPS = ("experiment", "dataset", "renderer", "sensor", "estimator", "density")
# The key of a group that names one of its files.
_FILE_NAMES = {"dataset": "source", "renderer": "name", "sensor": "name", "estimator": "kind"}


def load_config(directory: str | Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Compose, resolve and check the configuration.

    Parameters
    ----------
    directory : path
        The folder that holds ``config.yaml`` and the groups.
    overrides : sequence of str
        Hydra overrides such as ``experiment=quick`` or ``estimator.epochs=4``.

    Returns
    -------
    dict
        Plain Python values only, keys in the schema's order: what Snakemake can compare. Last
        comes ``gives_distributions``: whether the estimator gives each image's own distribution.

    Raises
    ------
    UserError
        One line that names the key, the value and what the key takes.
    """
    folder = Path(directory).resolve()
    composed = _composed(folder, [_checked(folder, override) for override in overrides])
    try:
        settings = Config.model_validate(composed).model_dump()
    except ValidationError as error:
        raise UserError(one_line(error)) from error
    # So that a key of one kind of estimator is no setting of another.
    estimator = {key: value for key, value in settings["estimator"].items() if value is not None}
    settings["estimator"] = estimator
    for group, key in _FILE_NAMES.items():
        _check_choice(folder, group, settings[group][key], f"{group}.{key}")
    for name, condition in settings["transfer"]["conditions"].items():
        _check_choice(folder, "sensor", condition["sensor"], f"transfer.conditions.{name}.sensor")
    settings["name"] = settings["name"] or _name(settings)
    if settings["calibration"] == "crossfit" and settings["crossfit_epochs"] is None:
        settings["crossfit_epochs"] = equal_cost_epochs(
            estimator["epochs"], settings["calibration_fraction"], settings["crossfit_parts"]
        )
    if settings["crossfit_epochs"] == 0:
        raise UserError(
            "crossfit_epochs=0 is out of range: 1 or more; null needs more estimator.epochs"
        )
    return settings | {"gives_distributions": "n_classes" in estimator}


def _checked(directory: Path, override: str) -> str:
    """Return an override as Hydra takes it, after a check of its key or its choice."""
    key, separator, value = override.partition("=")
    bare = key.lstrip("+~")
    if not separator and not key.startswith("~"):
        raise UserError(f"override {override!r} is not of the form key=value")
    if bare in GROUPS:
        _check_choice(directory, bare, value, bare)
        return override
    kind, _ = type_of(bare.split("."))
    if kind is str and value not in ("null", "") and value[0] not in "'\"":
        # Quoted, for Hydra's grammar has no place for ~, = or brackets in plain text.
        escaped = value.replace("'", "\\'")
        override = f"{key}='{escaped}'"
    # What may be there is for the schema to say, not for the files that are composed.
    return f"++{override}" if key == bare else override


def _check_choice(directory: Path, group: str, choice: str, key: str) -> None:
    choices = [path.stem for path in (directory / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{key}={choice} is unknown: {nearest(choice, choices)}")


def _composed(folder: Path, overrides: list[str]) -> Any:
    from hydra import compose, initialize_config_dir
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        with initialize_config_dir(str(folder), version_base="1.3"):
            composed = compose("config", overrides=overrides)
        return OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(f"configuration: {str(error).strip().splitlines()[0]}") from error


def _name(settings: Mapping[str, Any]) -> str:
    """Return the experiment's name and what sets a run apart from the experiment's own."""
    own = ("procedural", "regressor", "holdout")
    names = (settings["dataset"]["source"], settings["estimator"]["kind"], settings["calibration"])
    return "-".join([settings["experiment"], *(name for name in names if name not in own)])


def equal_cost_epochs(epochs: int, calibration_fraction: float, parts: int) -> int:
    """Return the epochs of cross-fitting that see as many images as the hold-out does, or fewer.

    Of n objects that are not tested, the hold-out trains on (1 - f) n, f being the calibration
    fraction. Cross-fitting in k parts trains k estimators on (1 - 1/k) n and one on n, which is
    k n in every epoch: e k <= epochs (1 - f). 0 where a single epoch is too much.
    """
    # Rounded first, for 10 * (1 - 0.4) / 2 falls short of 3.
    return int(round(epochs * (1.0 - calibration_fraction) / parts, 9))


def load_condition(
    directory: str | Path,
    overrides: Sequence[str],
    run: Mapping[str, Any],
    condition: Mapping[str, str],
) -> dict[str, Any]:
    """Return a run's configuration, as of `load_config`, with another sensor and framing.

    Parameters
    ----------
    directory, overrides
        What the run was composed of. Its overrides hold here too, but its sensor's parameters are
        no other sensor's.
    run : mapping
        Its configuration.
    condition : mapping
        ``sensor`` and ``framing``, from ``transfer.conditions``.
    """
    replaced = r"sensor|camera\.framing"
    if condition["sensor"] != run["sensor"]["name"]:
        replaced += r"|sensor\.parameters.*"
    kept = [o for o in overrides if not re.fullmatch(replaced, o.partition("=")[0].lstrip("+~"))]
    chosen = [f"sensor={condition['sensor']}", f"camera.framing={condition['framing']}"]
    return load_config(directory, [*kept, *chosen])


def snakemake_overrides(given: Mapping[str, Any]) -> list[str]:
    """Turn what came with Snakemake's ``--config`` into Hydra overrides.

    That is ``key=value`` pairs such as ``experiment=quick``, and ``overrides``, a list (or one
    string) of Hydra overrides for keys that Snakemake's command line cannot spell.

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
    """Read ``configuration.yaml`` of a run or reference as plain values, under today's names.

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
    settings = with_new_names({str(key): value for key, value in configuration.items()})
    return settings | {"gives_distributions": "n_classes" in settings.get("estimator", {})}

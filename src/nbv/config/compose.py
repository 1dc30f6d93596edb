"""A configuration as one plain dict: composed and checked, or read from a finished run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nbv.config.keys import one_line, with_new_names
from nbv.config.overrides import check_choice, checked_override
from nbv.config.schema import Config
from nbv.errors import UserError
from nbv.files import existing

# Each names a file of its group.
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
    composed = _composed(folder, [checked_override(folder, override) for override in overrides])
    try:
        settings = Config.model_validate(composed).model_dump()
    except ValidationError as error:
        raise UserError(one_line(error)) from error
    # So that a key of one kind of estimator is no setting of another.
    estimator = {key: value for key, value in settings["estimator"].items() if value is not None}
    settings["estimator"] = estimator
    for group, key in _FILE_NAMES.items():
        check_choice(folder, group, settings[group][key], f"{group}.{key}")
    for name, condition in settings["transfer"]["conditions"].items():
        check_choice(folder, "sensor", condition["sensor"], f"transfer.conditions.{name}.sensor")
    settings["name"] = settings["name"] or _name(settings)
    if settings["calibration"] == "crossfit" and settings["crossfit_epochs"] is None:
        settings["crossfit_epochs"] = equal_cost_epochs(
            estimator["epochs"], settings["calibration_fraction"], settings["crossfit_parts"]
        )
    if settings["crossfit_epochs"] == 0:
        raise UserError(
            "crossfit_epochs=0 is out of range: 1 or more; null needs more estimator.epochs"
        )
    return settings | {"gives_distributions": _gives_distributions(settings)}


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
    return settings | {"gives_distributions": _gives_distributions(settings)}


def _gives_distributions(settings: Mapping[str, Any]) -> bool:
    """Say whether an estimator gives a distribution over azimuths, as those with classes do."""
    return "n_classes" in settings.get("estimator", {})

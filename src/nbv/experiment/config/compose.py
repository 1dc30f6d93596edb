"""A configuration as one plain dict: composed and checked, or read from a finished run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nbv.errors import UserError, nearest
from nbv.experiment.config.keys import one_line, shortened, type_of
from nbv.experiment.config.schema import Config
from nbv.files import existing

GROUPS = ("experiment", "dataset", "renderer", "sensor", "randomisation", "estimator", "density")
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
        if any(mistake["type"] == "missing" for mistake in error.errors()):
            _check_files(folder)
        raise UserError(one_line(error.errors())) from error
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
        raise UserError(f"override {shortened(override)!r} is not of the form key=value")
    if bare in GROUPS:
        _check_choice(directory, bare, value, bare)
        return override
    kind, _ = type_of(bare.split("."))
    if value.replace(" ", "") == "{}":
        # Hydra merges mappings.
        raise UserError(f"{key}={{}} changes nothing; ~{bare}.<key> leaves a key out")
    if kind is str and value not in ("null", "") and value[0] not in "'\"":
        # Quoted, for Hydra's grammar has no place for ~, = or brackets in plain text. There a
        # backslash stands for itself, except before a quote.
        escaped = re.sub(r"(\\*)('|$)", lambda m: 2 * m[1] + m[2].replace("'", r"\'"), value)
        override = f"{key}='{escaped}'"
    # What may be there is for the schema to say, not for the files that are composed.
    return f"++{override}" if key == bare else override


def _check_choice(directory: Path, group: str, choice: str, key: str) -> None:
    choices = [path.stem for path in (directory / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{key}={shortened(choice)} is unknown: {nearest(choice, choices)}")


def _composed(folder: Path, overrides: list[str]) -> Any:
    from hydra import compose, initialize_config_dir
    from omegaconf import OmegaConf

    try:
        with initialize_config_dir(str(folder), version_base="1.3"):
            composed = compose("config", overrides=overrides)
        return OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
    # No list of what a parser may raise on arbitrary text is complete.
    except Exception as error:
        raise UserError(_why_not_composed(folder, overrides, error)) from error


def _why_not_composed(folder: Path, overrides: Sequence[str], error: Exception) -> str:
    """Return what could not be composed: an override, a file or a key."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    parser = OverridesParser.create()
    for override in overrides:
        written = f"override {shortened(override.removeprefix('++'))!r}"
        try:
            several = parser.parse_override(override).is_sweep_override()
        except Exception as fault:
            return f"{written} cannot be read: {_first_line(fault)}; quote what is text"
        if several:
            return f"{written} holds several values; write a list as [1,2]"
    _check_files(folder)
    key = getattr(error, "full_key", None)
    return f"configuration{f' key {key!r}' if key else ''}: {_first_line(error)}"


def _check_files(folder: Path) -> None:
    """Raise UserError for a file of the configuration that is damaged."""
    for path in sorted(folder.rglob("*.yaml")):
        read_mapping(path)


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return shortened(lines[0]) if lines else type(error).__name__


def read_mapping(path: Path) -> dict[str, Any]:
    """Read a YAML file that holds a mapping, as plain values; interpolations stay as written.

    Raises
    ------
    UserError
        With the path and the reason, where it cannot be read.
    """
    import yaml
    from omegaconf import OmegaConf

    try:
        text = path.read_text(encoding="utf-8")
        events = list(yaml.parse(text, yaml.SafeLoader))
        # A few aliases of aliases fill any memory; the program writes none.
        if any(isinstance(event, yaml.AliasEvent) for event in events):
            raise UserError(f"{path}: aliases (*name) are not allowed; write the value again")
        # After the beginnings of the stream and of its document.
        holds_keys = any(isinstance(event, yaml.MappingStartEvent) for event in events[2:3])
        content = OmegaConf.to_container(OmegaConf.create(text if holds_keys else "{}"))
    except UserError:
        raise
    except UnicodeDecodeError as error:
        raise UserError(f"{path} cannot be read: it is not UTF-8 text") from error
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from error
    # No list of what a parser may raise on arbitrary text is complete.
    except Exception as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        where = f" in line {mark.line + 1}" if mark else ""
        reason = " ".join(str(problem or error).split()) or type(error).__name__
        raise UserError(f"{path} cannot be read as YAML{where}: {shortened(reason)}") from error
    if not isinstance(content, dict) or not content:
        raise UserError(f"{path} holds no settings")
    return {str(key): value for key, value in content.items()}


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


SHORT_NAMES = {"from": "confirmation.kept"}
"""Keys of Snakemake's ``--config`` that are shorter than those of the configuration."""


def snakemake_overrides(given: Mapping[str, Any]) -> list[str]:
    """Turn what came with Snakemake's ``--config`` into Hydra overrides.

    That is ``key=value`` pairs such as ``experiment=quick`` (`SHORT_NAMES` are known), and
    ``overrides``, a list (or one string) of Hydra overrides for keys that Snakemake's command line
    cannot spell.

    Raises
    ------
    UserError
        For a value that is neither text nor a number.
    """
    overrides = []
    for key, value in given.items():
        if key == "overrides":
            continue
        if key in SHORT_NAMES:
            items = value if isinstance(value, list) else _items(str(value))
            value = f"[{','.join(map(str, items))}]"
        if not isinstance(value, str | int | float) and value is not None:
            raise UserError(f'--config {shortened(key)}: write it as overrides="[{key}=...]"')
        name = SHORT_NAMES.get(key, key)
        overrides.append(f"{name}={'null' if value is None else value}")
    extra = given.get("overrides")
    if extra is None:
        return overrides
    if not isinstance(extra, str | list):
        raise UserError(
            f'--config overrides={shortened(extra)}: write it as overrides="[key=value,…]"'
        )
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


def read_configuration(root: Path, needed: Sequence[str] = ()) -> dict[str, Any]:
    """Read ``configuration.yaml`` of a run or reference as plain values.

    What it says is checked as of `load_config`. It may lack keys, which are younger than it, and
    may have others.

    Parameters
    ----------
    root : pathlib.Path
        The folder of the run or reference.
    needed : sequence of str
        Keys that have to be there, as ``n_folds`` always has.

    Raises
    ------
    UserError
        One line that names the file and what is wrong with it.
    """
    path = existing(root / "configuration.yaml")
    settings = read_mapping(path)
    try:
        for key in ("n_folds", *needed):
            if key not in settings:
                raise UserError(f"{key} is missing")
        _check_kept(settings)
    except UserError as error:
        raise UserError(f"{path}: {error}; the file is damaged: make it again") from error
    return settings | {"gives_distributions": "n_classes" in settings.get("estimator", {})}


def _check_kept(settings: Mapping[str, Any]) -> None:
    try:
        Config.model_validate(settings)
    except ValidationError as error:
        of_other_times = ("missing", "extra_forbidden")
        mistakes = [each for each in error.errors() if each["type"] not in of_other_times]
        if mistakes:
            raise UserError(one_line(mistakes)) from error
    # The model compares keys with each other only where none is missing.
    for category in settings.get("categories", []):
        if category not in settings.get("elevations_deg", {}):
            raise UserError(f"elevations_deg.{category} is missing")

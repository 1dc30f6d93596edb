"""The configuration: Hydra composes it, pydantic checks it, plain dicts pass it on."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from nbv.errors import UserError, nearest
from nbv.experiment.config.schema import Config
from nbv.experiment.estimation.features import read_features_provenance
from nbv.files import existing

GROUPS = ("experiment", "dataset", "renderer", "sensor", "randomisation", "estimator", "density")
# The key of a group that names one of its files.
_FILE_NAMES = {"dataset": "source", "renderer": "name", "sensor": "name", "estimator": "kind"}

# The estimator of an experiment where it is not the regressor.
_ESTIMATORS = {"quick": "linear"}

_LONGEST = 80
"""Characters of a value that a message repeats."""

SHORT_NAMES = {"from": "confirmation.kept"}
"""Short forms of configuration keys, for Snakemake's ``--config``."""


def snakemake_overrides(given: Mapping[str, Any]) -> list[str]:
    """Turn the values of Snakemake's ``--config`` into Hydra overrides.

    These are ``key=value`` pairs such as ``experiment=quick``, also with `SHORT_NAMES`, and
    ``overrides``, a list of Hydra overrides for keys that Snakemake's command line cannot spell.
    Snakemake passes on as text what YAML cannot read, such as ``[a=1,b=[2,3]]``, and cuts at every
    comma what YAML can. Raise UserError for a value that is neither text nor a number.
    """
    overrides = []
    for key, value in given.items():
        if key == "overrides":
            continue
        if key in SHORT_NAMES:
            text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
            value = f"[{text.removeprefix('[').removesuffix(']')}]"
        if not isinstance(value, str | int | float) and value is not None:
            raise UserError(f'--config {shortened(key)}: write it as overrides="[{key}=...]"')
        name = SHORT_NAMES.get(key, key)
        overrides.append(f"{name}={'null' if value is None else value}")
    more = given.get("overrides", "")
    more = "" if more is None else more
    if not isinstance(more, str | list):
        raise UserError(
            f'--config overrides={shortened(more)}: write it as overrides="[key=value,…]"'
        )
    text = more if isinstance(more, str) else ",".join(map(str, more))
    if text.startswith("[") and text.endswith("]"):
        text = text[1:-1]
    # A comma separates overrides only where another key follows.
    items = re.split(r",\s*(?=[+~]*[\w.]+=|~)", text)
    return overrides + [item.strip() for item in items if item.strip()]


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
        comes ``gives_distributions``: whether the estimator gives a distribution for each image.

    Raises
    ------
    UserError
        One line with the key, the value and the values that the key takes.
    """
    folder = Path(directory).resolve()
    composed = _compose(folder, [_checked(folder, override) for override in overrides])
    try:
        settings = Config.model_validate(composed).model_dump()
    except ValidationError as error:
        if any(mistake["type"] == "missing" for mistake in error.errors()):
            _check_files(folder)
        raise UserError(one_line(error.errors())) from error
    # A key of one kind of estimator is not a setting of another.
    estimator = {key: value for key, value in settings["estimator"].items() if value is not None}
    settings["estimator"] = estimator
    for group, key in _FILE_NAMES.items():
        _check_choice(folder, group, settings[group][key], f"{group}.{key}")
    for name, condition in settings["transfer"]["conditions"].items():
        _check_choice(folder, "sensor", condition["sensor"], f"transfer.conditions.{name}.sensor")
    settings["name"] = settings["name"] or _run_name(settings)
    if estimator.get("warm_start") == "features":
        # Whose weights a network takes, its size it takes too.
        made_with = read_features_provenance()["settings"]["estimator"]
        estimator |= {key: made_with[key] for key in ("channels", "hidden")}
    is_trained = "epochs" in estimator
    if settings["calibration"] == "crossfit" and settings["crossfit_epochs"] is None and is_trained:
        settings["crossfit_epochs"] = equal_cost_epochs(
            estimator["epochs"], settings["calibration_fraction"], settings["crossfit_parts"]
        )
        if settings["crossfit_epochs"] == 0:
            raise UserError(
                f"crossfit_parts={settings['crossfit_parts']}: estimator.epochs="
                f"{estimator['epochs']} leaves less than one epoch for each part; give fewer "
                "parts, more epochs, or crossfit_epochs"
            )
    return settings | {"gives_distributions": "n_classes" in estimator}


def _checked(folder: Path, override: str) -> str:
    """Return an override as Hydra takes it, after a check of its key and choice."""
    key, separator, value = override.partition("=")
    bare = key.lstrip("+~")
    if not separator and not key.startswith("~"):
        raise UserError(f"override {shortened(override)!r} is not of the form key=value")
    if bare in GROUPS:
        _check_choice(folder, bare, value, bare)
        return override
    kind = type_of(bare.split("."))
    if value.replace(" ", "") == "{}":
        # Hydra merges mappings.
        raise UserError(f"{key}={{}} changes nothing; ~{bare}.<key> leaves a key out")
    taken = override
    if kind is str and value not in ("null", "") and value[0] not in "'\"":
        # Quoted, because Hydra's grammar does not allow ~, = or brackets in plain text. There a
        # backslash stands for itself, except before a quote.
        escaped = re.sub(r"(\\*)('|$)", lambda m: 2 * m[1] + m[2].replace("'", r"\'"), value)
        taken = f"{key}='{escaped}'"
    # The schema decides which keys exist, not the files that are composed.
    return f"++{taken}" if key == bare else taken


def _check_choice(folder: Path, group: str, choice: str, key: str) -> None:
    choices = [path.stem for path in (folder / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{key}={shortened(choice)} is unknown: {nearest(choice, choices)}")


def _compose(folder: Path, overrides: list[str]) -> Any:
    from hydra import compose, initialize_config_dir
    from hydra.errors import HydraException, OverrideParseException
    from omegaconf import OmegaConf

    try:
        with initialize_config_dir(str(folder), version_base="1.3"):
            composed = compose("config", overrides=overrides)
        return OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
    except OverrideParseException as error:
        override = shortened(error.override.removeprefix("++"))
        raise UserError(
            f"override {override!r} cannot be read: {_first_line(error)}; put text in quotes"
        ) from error
    except HydraException as error:
        _check_files(folder)
        # Of several values, Hydra's further lines say how to write a list.
        lines = "; ".join(map(shortened, str(error).splitlines()))
        raise UserError(f"configuration: {lines}") from error
    # No list of what arbitrary text may raise is complete.
    except Exception as error:
        _check_files(folder)
        key = getattr(error, "full_key", None)
        named = f"configuration{f' key {key!r}' if key else ''}"
        raise UserError(f"{named}: {_first_line(error)}") from error


def _check_files(folder: Path) -> None:
    """Raise UserError for a damaged file of the configuration."""
    for path in sorted(folder.rglob("*.yaml")):
        _read_mapping(path)


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return shortened(lines[0]) if lines else type(error).__name__


def _read_mapping(path: Path) -> dict[str, Any]:
    """Read a YAML file that holds a mapping as plain values, without resolving interpolations."""
    from omegaconf import OmegaConf

    try:
        content = OmegaConf.to_container(OmegaConf.load(path))
    except Exception as error:
        mark = getattr(error, "problem_mark", None)
        where = f" in line {mark.line + 1}" if mark else ""
        reason = " ".join(str(getattr(error, "problem", None) or error).split())
        raise UserError(f"{path} cannot be read as YAML{where}: {shortened(reason)}") from error
    if not isinstance(content, dict) or not content:
        raise UserError(f"{path} holds no settings")
    return {str(key): value for key, value in content.items()}


def _run_name(settings: Mapping[str, Any]) -> str:
    """Return the experiment's name, followed by the choices that differ from the experiment's."""
    usual = ("procedural", _ESTIMATORS.get(settings["experiment"], "regressor"), "holdout")
    names = (settings["dataset"]["source"], settings["estimator"]["kind"], settings["calibration"])
    return "-".join([settings["experiment"], *(name for name in names if name not in usual)])


def equal_cost_epochs(epochs: int, calibration_fraction: float, parts: int) -> int:
    """Return the epochs of cross-fitting that see at most as many images as the hold-out does.

    Of n objects that are not tested, the hold-out trains on (1 - f) n, f being the calibration
    fraction. Cross-fitting in k parts trains k estimators on (1 - 1/k) n and one on n, which is
    k n in every epoch: e k <= epochs (1 - f). 0 where a single epoch is too much.
    """
    # Rounded first, because 10 * (1 - 0.4) / 2 falls short of 3.
    return int(round(epochs * (1.0 - calibration_fraction) / parts, 9))


def read_configuration(root: Path, needed: Sequence[str] = ()) -> dict[str, Any]:
    """Read ``configuration.yaml`` of a run or reference as plain values, with the keys `needed`.

    Its values are checked as in `load_config`. A file of another version may lack keys, and may
    have keys that are unknown today; ``n_folds`` is always required.

    Raises
    ------
    UserError
        One line with the file and the first mistake in it.
    """
    path = existing(root / "configuration.yaml")
    settings = _read_mapping(path)
    try:
        for key in ("n_folds", *needed):
            if key not in settings:
                raise UserError(f"{key} is missing")
        try:
            Config.model_validate(settings)
        except ValidationError as error:
            other_version = ("missing", "extra_forbidden")
            mistakes = [each for each in error.errors() if each["type"] not in other_version]
            if mistakes:
                raise UserError(one_line(mistakes)) from error
        # The schema compares keys with each other only where none is missing.
        for category in settings.get("categories", []):
            if category not in settings.get("elevations_deg", {}):
                raise UserError(f"elevations_deg.{category} is missing")
    except UserError as error:
        raise UserError(f"{path}: {error}; the file is damaged: make it again") from error
    return settings | {"gives_distributions": "n_classes" in settings.get("estimator", {})}


def _fields_of(kind: Any) -> dict[str, FieldInfo]:
    """Return the fields of a section of the schema by key; none where it is not a section."""
    return kind.model_fields if isinstance(kind, type) and issubclass(kind, BaseModel) else {}


def type_of(parts: Sequence[str | int]) -> Any:
    """Return the type of a key, from its names and the indices of list items.

    It is without annotations and None. Raise UserError for an unknown key, with the
    nearest one.
    """
    kind: Any = Config
    for depth, part in enumerate(parts):
        fields = _fields_of(kind)
        if part in fields:
            kind = _unwrap(fields[str(part)].annotation)
        elif get_origin(kind) in (dict, list):
            kind = _unwrap(get_args(kind)[-1])
        else:
            written = _dotted(parts[: depth + 1])
            known = [_dotted([*parts[:depth], name]) for name in fields]
            hint = nearest(written, known) if fields else "a value has no keys"
            raise UserError(f"configuration key {shortened(written)!r} is unknown: {hint}")
    return kind


def _unwrap(kind: Any) -> Any:
    """Return a type without its annotations and without None."""
    if get_origin(kind) is Annotated or type(None) in get_args(kind):
        return _unwrap(get_args(kind)[0])
    return kind


def _dotted(parts: Sequence[str | int]) -> str:
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in parts).lstrip(".")


def default_of(key: str, otherwise: Any) -> Any:
    """Return the default of a dotted key, or `otherwise` where it has none."""
    *above, last = key.split(".")
    with contextlib.suppress(UserError, KeyError):
        field = _fields_of(type_of(above))[last]
        if not field.is_required():
            default = field.get_default(call_default_factory=True)
            return default.model_dump() if isinstance(default, BaseModel) else default
    return otherwise


def shortened(value: Any) -> str:
    """Return a value as text for a message, without its middle where it is long."""
    text, half = str(value), _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]} … {text[-half:]}"


def one_line(mistakes: Sequence[ErrorDetails]) -> str:
    """Return the first of pydantic's mistakes as one line: key, value, and allowed values.

    Raise UserError for an unknown key; see `type_of`.
    """
    # An unknown key first: the key that it was meant for is then missing, too.
    mistake = min(mistakes, key=lambda each: each["type"] != "extra_forbidden")
    parts = [part for part in mistake["loc"] if part != "[key]"]
    kind, key = type_of(parts), shortened(_dotted(parts))
    given = f"{key}={shortened(mistake['input'])}"
    match mistake["type"]:
        case "missing":
            return f"{key} is missing"
        case "value_error":
            return f"{given}: {mistake['ctx']['error']}"
        case "literal_error":
            return f"{given} is unknown: {nearest(str(mistake['input']), get_args(kind))}"
    message = mistake["msg"]
    return f"{given}: {message[0].lower()}{message[1:]}"

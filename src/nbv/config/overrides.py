"""Overrides: as Snakemake hands them over, and as Hydra takes them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nbv.config.keys import type_of
from nbv.errors import UserError, nearest

GROUPS = ("experiment", "dataset", "renderer", "sensor", "estimator", "density")


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


def check_choice(directory: Path, group: str, choice: str, key: str) -> None:
    """Raise UserError where a group of the configuration has no file of that name."""
    choices = [path.stem for path in (directory / group).glob("*.yaml")]
    if choice not in choices:
        raise UserError(f"{key}={choice} is unknown: {nearest(choice, choices)}")


def checked_override(directory: Path, override: str) -> str:
    """Return an override as Hydra takes it, after a check of its key or its choice.

    Raises
    ------
    UserError
        For an unknown key or choice, and for text that is not of the form ``key=value``.
    """
    key, separator, value = override.partition("=")
    bare = key.lstrip("+~")
    if not separator and not key.startswith("~"):
        raise UserError(f"override {override!r} is not of the form key=value")
    if bare in GROUPS:
        check_choice(directory, bare, value, bare)
        return override
    kind, _ = type_of(bare.split("."))
    if kind is str and value not in ("null", "") and value[0] not in "'\"":
        # Quoted, for Hydra's grammar has no place for ~, = or brackets in plain text.
        escaped = value.replace("'", "\\'")
        override = f"{key}='{escaped}'"
    # What may be there is for the schema to say, not for the files that are composed.
    return f"++{override}" if key == bare else override

"""Type and default of each dotted key, and the one line that refuses a mistake."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from nbv.errors import UserError, nearest
from nbv.experiment.config.schema import NAME_RULE, Config

_BOUNDS = ("ge", "gt", "le", "lt", "min_length", "max_length")
_RANGES = {
    ("ge", "le"): "{ge} to {le}",
    ("gt", "le"): "above {gt}, {le} at most",
    ("gt", "lt"): "between {gt} and {lt}",
    ("min_length",): "one or more",
    ("min_length", "max_length"): "one or more, {max_length} at most",
}
_LONGEST = 80
"""Characters of a value that a message repeats."""
_TYPES = {int: "a whole number", float: "a number", str: "text", list: "a list"}


def fields_of(kind: Any) -> dict[str, FieldInfo]:
    """Return the fields of a section of the schema by key; none of what is no section."""
    return kind.model_fields if isinstance(kind, type) and issubclass(kind, BaseModel) else {}


def type_of(parts: Sequence[str | int]) -> tuple[Any, list[Any]]:
    """Return the type of a key, and the marks that give its range.

    Parameters
    ----------
    parts : sequence of str or int
        The names in a dotted key, and the indices of list items.

    Raises
    ------
    UserError
        For an unknown key: one line with the nearest key.
    """
    kind: Any = Config
    marks: list[Any] = []
    for depth, part in enumerate(parts):
        fields = fields_of(kind)
        if part in fields:
            kind, marks = _opened(fields[str(part)].annotation, fields[str(part)].metadata)
        elif get_origin(kind) in (dict, list):
            kind, marks = _opened(get_args(kind)[-1], [])
        else:
            raise UserError(_unknown_key(parts[: depth + 1], fields))
    return kind, marks


def _opened(kind: Any, marks: Sequence[Any]) -> tuple[Any, list[Any]]:
    """Take a type out of its annotations, and out of what null may replace."""
    if get_origin(kind) is Annotated:
        inner, *more = get_args(kind)
        inside = [each for mark in more for each in getattr(mark, "metadata", [mark])]
        return _opened(inner, [*marks, *inside])
    if type(None) in get_args(kind):
        return _opened(get_args(kind)[0], marks)
    return kind, list(marks)


def _dotted(parts: Sequence[str | int]) -> str:
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in parts).lstrip(".")


def default_of(key: str, otherwise: Any) -> Any:
    """Return the default of a dotted key, `otherwise` where it has none."""
    *above, last = key.split(".")
    with contextlib.suppress(UserError, KeyError):
        field = fields_of(type_of(above)[0])[last]
        if not field.is_required():
            default = field.get_default(call_default_factory=True)
            return default.model_dump() if isinstance(default, BaseModel) else default
    return otherwise


def _unknown_key(parts: Sequence[str | int], fields: Mapping[str, FieldInfo]) -> str:
    *above, _ = parts
    written = _dotted(parts)
    meant = nearest(written, [_dotted([*above, known]) for known in fields])
    hint = meant if fields else "a value has no keys"
    return f"configuration key {shortened(written)!r} is unknown: {hint}"


def shortened(value: Any) -> str:
    """Return a value as text for a message, its middle left out where it is long."""
    try:
        text = str(value)
    except ValueError:  # Python writes no integer of more than 4,300 digits.
        return "a number of thousands of digits"
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]} … {text[-half:]}"


def one_line(mistakes: Sequence[ErrorDetails]) -> str:
    """Return the first of pydantic's mistakes as one line: key, value, and what the key takes.

    Raises
    ------
    UserError
        As of `type_of`, where the mistake is an unknown key.
    """
    # An unknown key first: the key that it was meant for is missing then, too.
    mistake = min(mistakes, key=lambda each: each["type"] != "extra_forbidden")
    place = list(mistake["loc"])
    if place[-1:] == ["[key]"]:
        return f"{shortened(_dotted(place[:-1]))}: {NAME_RULE}"
    kind, marks = type_of(place)
    key, context = shortened(_dotted(place)), mistake.get("ctx", {})
    given = f"{key}={shortened(mistake['input'])}"
    match mistake["type"]:
        case "missing":
            return f"{key} is missing"
        case "value_error":
            return f"{key}: {context['error']}"
        case "string_pattern_mismatch":
            return f"{given}: {_notes(marks)}"
        case "literal_error":
            return f"{given} is unknown: {nearest(str(mistake['input']), get_args(kind))}"
        case "finite_number":
            return f"{given} is out of range: a finite number"
    if any(bound in context for bound in _BOUNDS):
        return f"{given} is out of range: {_range_text(marks)}"
    return f"{given} is not {_TYPES.get(get_origin(kind) or kind, 'a mapping')}"


def _range_text(marks: Sequence[Any]) -> str:
    bounds = {
        name: getattr(mark, name) for name in _BOUNDS for mark in marks if hasattr(mark, name)
    }
    return ", ".join(
        text for text in (_RANGES[tuple(bounds)].format(**bounds), _notes(marks)) if text
    )


def _notes(marks: Sequence[Any]) -> str:
    return ", ".join(mark for mark in marks if isinstance(mark, str))

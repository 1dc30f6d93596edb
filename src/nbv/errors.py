"""Errors for the user: mistakes in the input, with their remedy."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # In `typing` from Python 3.11 on.
    from typing_extensions import Self

# Messages of libraries about a file, and what they mean for its author; `{…}` is a group.
_REASONS = (
    (".*(Object a|objects in).*", "it holds Python objects (pickled); save an array of numbers"),
    # numpy takes any other content for pickled objects, and advises to load them unsafely.
    (".*allow_pickle.*", "it is not an array of numbers"),
    ("File is not a zip file", "it is not an .npz file, or only a part of one"),
    (".*context manager protocol.*", "it is one array and not an .npz file"),
    ("could not convert string to float: (.*)", "{0} is not a number"),
    ("No columns to parse from file", "it is empty"),
    (
        r".*Expected (\d+) fields in line (\d+), saw (\d+)",
        "line {1} has {2} columns instead of {0}: is there an extra comma, or are quotes missing?",
    ),
    (
        r".*EOF inside string starting at row \d+|unexpected end of data",
        "a cell has an opening quote and no closing one",
    ),
)


def reason_of(error: Exception) -> str:
    """Return why a file could not be read, in one line, with the position in a text if known."""
    reason = " ".join(str(error).split()) or type(error).__name__
    if isinstance(error, json.JSONDecodeError):
        return f"line {error.lineno}, column {error.colno} is not JSON; correct it there"
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8 text"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    # By name, because yaml is imported only where a file is read.
    if type(error).__module__.partition(".")[0] == "yaml":
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            return "it is not YAML"
        return f"line {mark.line + 1}, column {mark.column + 1} is not YAML; correct it there"
    for pattern, meaning in _REASONS:
        if found := re.fullmatch(pattern, reason):
            return meaning.format(*found.groups())
    return reason


def check_number(name: str, value: object) -> None:
    """Raise UserError unless a value is a number; text is not."""
    try:
        if not isinstance(value, str | bytes):
            float(value)  # type: ignore[arg-type]
            return
    except (TypeError, ValueError):
        pass
    except OverflowError:
        raise UserError(f"{name}: the number is too large") from None
    raise UserError(f"{name}: {value!r} is not a number")


def printable(text: str) -> str:
    """Return a text with unprintable characters, such as line breaks, escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class UserError(Exception):
    """A mistake in the input: one line that names the file, key or value, and the remedy.

    Unprintable characters, such as a line break in a file's name, are escaped.

    Examples
    --------
    >>> import nbv
    >>> try:
    ...     nbv.Intrinsics(0.0, 585.0)
    ... except nbv.UserError as error:
    ...     print(error)
    intrinsics: fx=0 must be above 0 (pixels)
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))

    def about(self, what: str) -> Self:
        """Return the same error with its subject in front of the message."""
        return type(self)(f"{what}: {self}")


class NamedError(UserError):
    """An error with a stable name, such as ``empty-mask``, for programs.

    The text of the error is the name and then the message.
    """

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name
        self.message = message

    def about(self, what: str) -> Self:
        """Return the same error with its subject between the name and the message."""
        return type(self)(self.name, f"{what}: {self.message}")


class FrameError(NamedError):
    """A frame that cannot be used; the name of the error is the reason.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> frame = nbv.example_frame()
    >>> try:
    ...     nbv.Recommender.load("mug").recommend(frame.depth_m, mask=np.zeros((480, 640)))
    ... except nbv.FrameError as error:
    ...     error.name
    'empty-mask'
    """


class BundleError(NamedError):
    """A file that is not a valid bundle; the name of the error is the reason.

    Examples
    --------
    >>> import nbv
    >>> try:
    ...     nbv.Recommender.load("cup")
    ... except nbv.BundleError as error:
    ...     error.name
    'no-bundle'
    """


def by_number(name: str) -> str:
    """Return the key by which names are in order of their numbers: 2 before 10."""
    return re.sub(r"\d+", lambda digits: digits[0].zfill(20), name)


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return ``did you mean 'x'?`` if a valid name is close, else ``choose from: a, b, c``.

    Numbers are never close, and are listed in their order.
    """
    choices = sorted(valid, key=by_number)
    close = [] if name.isdecimal() else difflib.get_close_matches(name, choices, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {', '.join(choices)}"

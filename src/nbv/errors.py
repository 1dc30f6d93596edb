"""Mistakes that are the user's to mend, and the help they give."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable
from typing import Self

# What libraries say of a file, and what it means for whoever wrote it; `{…}` is a group.
_REASONS = (
    # numpy takes whatever is no array of its own for objects, and tells to load them unsafely.
    (".*allow_pickle.*", "it holds no array of numbers"),
    ("File is not a zip file", "it is no .npz file, or only a part of one"),
    (".*context manager protocol.*", "it is one array, and no .npz file"),
    ("could not convert string to float: (.*)", "{0} is not a number"),
    ("No columns to parse from file", "it is empty"),
    (
        r".*Expected (\d+) fields in line (\d+), saw (\d+)",
        "line {1} has {2} columns in place of {0}: is a comma too many, or are quotes missing?",
    ),
    (
        r".*EOF inside string starting at row \d+",
        "a cell begins with a quote and has no second one",
    ),
)


def reason_of(error: Exception) -> str:
    """Return why a file could not be read, in one line; where it is known, the place in a text."""
    reason = " ".join(str(error).split()) or type(error).__name__
    if isinstance(error, json.JSONDecodeError):
        return f"line {error.lineno}, column {error.colno} is no JSON; mend it there"
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8 text"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    # yaml is imported where a file is read, and not for this.
    if type(error).__module__.partition(".")[0] == "yaml":
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            return "it is no YAML"
        return f"line {mark.line + 1}, column {mark.column + 1} is no YAML; mend it there"
    for pattern, meaning in _REASONS:
        if found := re.fullmatch(pattern, reason):
            return meaning.format(*found.groups())
    return reason


def check_number(name: str, value: object) -> None:
    """Raise UserError where a value is not a number, such as a text of one."""
    try:
        if not isinstance(value, str | bytes):
            float(value)  # type: ignore[arg-type]
            return
    except (TypeError, ValueError):
        pass
    except OverflowError:
        raise UserError(f"{name}: the number is too large") from None
    raise UserError(f"{name}: {value!r} is not a number")


class UserError(Exception):
    """A mistake in the input: one line that names the file, key or value, and what to do.

    What cannot be printed, such as the line break in a file's name, is shown by its escape.

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
        shown = (c if c.isprintable() else ascii(c)[1:-1] for c in message)
        super().__init__("".join(shown))

    def about(self, what: str) -> Self:
        """Return the same mistake with a message that says first what it is about.

        Examples
        --------
        >>> import nbv
        >>> print(nbv.UserError("no pixel").about("frame 2 of 3"))
        frame 2 of 3: no pixel
        """
        return type(self)(f"{what}: {self}")


class NamedError(UserError):
    """A mistake that has a name, for programs.

    Attributes
    ----------
    name : str
        Stable, such as ``empty-mask``; the message starts with it.
    message : str
        What follows the name.
    """

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name
        self.message = message

    def about(self, what: str) -> Self:
        """Return the same mistake; after its name, the message says first what it is about.

        Examples
        --------
        >>> import nbv
        >>> print(nbv.FrameError("empty-mask", "no pixel").about("frame 2 of 3"))
        empty-mask: frame 2 of 3: no pixel
        """
        return type(self)(self.name, f"{what}: {self.message}")


class FrameError(NamedError):
    """Frames that no estimate should be made of; its name is the reason.

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
    """A file that is no sound bundle; its name is the reason.

    Examples
    --------
    >>> import nbv
    >>> try:
    ...     nbv.Recommender.load("cup")
    ... except nbv.BundleError as error:
    ...     error.name
    'no-bundle'
    """


def nearest(name: str, valid: Iterable[str]) -> str:
    """Say what was probably meant by a misspelt name.

    Parameters
    ----------
    name : str
        What the user wrote.
    valid : iterable of str
        What could have been written.

    Returns
    -------
    str
        ``"did you mean 'x'?"`` where a valid name is close, else ``"choose from: a, b, c"``.
    """
    choices = sorted(valid)
    close = difflib.get_close_matches(name, choices, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {', '.join(choices)}"

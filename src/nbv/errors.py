"""Mistakes that are the user's to mend, and the help they give."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Self


def reason_of(error: Exception) -> str:
    """Return why a file could not be read, in one line."""
    reason = " ".join(str(error).split()) or type(error).__name__
    # numpy takes whatever is no array of its own for objects, and tells to load them unsafely.
    return "it holds no array of numbers" if "allow_pickle" in reason else reason


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

"""What stands on the command line: lists of numbers, cameras, and files to write."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

from cyclopts import Parameter, Token

from nbv.errors import UserError

Command = TypeVar("Command", bound=Callable[..., None])


def as_whole_number(_kind: Any, tokens: Sequence[Token]) -> int:
    """Return the whole number of an option, which is not rounded to one."""
    return int(_number(int, tokens[0].value))


def _number(kind: Callable[[str], float], text: str) -> float:
    try:
        return kind(text)
    except ValueError:
        what = "whole number" if kind is int else "number"
        raise ValueError(f"{text!r} is no {what}") from None


def as_numbers(kind: Any, tokens: Sequence[Token]) -> list[Any]:
    """Return the numbers of an option, between commas or spaces; `kind` is a list of some type."""
    (kind_of_number,) = kind.__args__
    texts = [text for token in tokens for text in token.value.replace(",", " ").split()]
    if not texts:
        raise ValueError("give a number")
    return [_number(kind_of_number, text) for text in texts]


def as_rotations_or_file(_kind: Any, tokens: Sequence[Token]) -> list[float] | Path:
    """Return the numbers of an option, or the file that its one value names."""
    if len(tokens) == 1 and tokens[0].value and not _is_numbers(tokens[0].value):
        return Path(tokens[0].value)
    return as_numbers(list[float], tokens)


def _list_parameter(converter: Callable[..., Any], metavar: str) -> Parameter:
    return Parameter(converter=converter, n_tokens=1, negative=(), metavar=metavar)


Numbers = Annotated[list[float] | None, _list_parameter(as_numbers, "NUMBER...")]
# -z is an axis here, and no option.
FileAxis = Annotated[str, Parameter(allow_leading_hyphen=True)]
WholeNumbers = Annotated[list[int] | None, _list_parameter(as_numbers, "NUMBER...")]
WholeNumber = Annotated[int, Parameter(converter=as_whole_number, n_tokens=1, metavar="INT")]
Rotations = Annotated[
    list[float] | Path | None, _list_parameter(as_rotations_or_file, "NUMBER...|FILE")
]

Json = Annotated[bool, Parameter(negative=())]

SHIPPED = "mug"
"""The bundle that is taken where none is named."""


_FLAGS = {
    "allowed_deg": "--allowed",
    "bundle": "--bundle",
    "depth_scale": "--depth-scale",
    "far_m": "--far",
    "intrinsics": "--intrinsics",
    "max_travel_deg": "--max-travel",
    "near_m": "--near",
    "output": "--output",
}


def in_flags(message: str) -> str:
    """Return a library's message with its `parameters` as the flags of the command line."""
    return re.sub("`([a-z_]+)`", lambda found: _FLAGS.get(found[1], found[0]), message)


def as_paragraphs(command: Command) -> Command:
    """Return a command whose help has a line for each paragraph; what prints it wraps it.

    The help in plain text breaks lines where the docstring does, and then again.
    """
    joined: list[str] = []
    head, _, parameters = inspect.cleandoc(command.__doc__ or "").partition("\nParameters\n")
    for line in parameters.splitlines():
        if line.startswith(" ") and joined[-1].startswith(" "):
            joined[-1] += f" {line.strip()}"
        else:
            joined.append(line)
    paragraphs = (" ".join(paragraph.split()) for paragraph in head.split("\n\n"))
    command.__doc__ = "\n".join(["\n\n".join(paragraphs), "", "Parameters", *joined])
    return command


OF_NUMBERS = ("--rotations", "--allowed", "--axis", "--gravity", "--views", "--intrinsics")


def joined_numbers(arguments: Sequence[str]) -> list[str]:
    """Return arguments in which the numbers after an option of `OF_NUMBERS` are one.

    The list ends where no number follows: the frame in ``--rotations 0 90 frame.npy`` is none.
    """
    found: list[str] = []
    for argument in arguments:
        if found and found[-1].split("=")[0] in OF_NUMBERS and _is_numbers(argument):
            found[-1] += ("," if "=" in found[-1] else "=") + argument
        else:
            found.append(argument)
    return found


def _is_numbers(text: str) -> bool:
    parts = text.replace(",", " ").split()
    try:
        return bool([float(part) for part in parts])
    except ValueError:
        return False


def allowed_rotations(given: list[float] | Path | None) -> Any:
    """Return the rotations of ``--allowed``, read where it names a file."""
    from nbv.robot.moves import read_rotations

    return read_rotations(given) if isinstance(given, Path) else given


def check_writable(option: str, path: Path, kinds: Sequence[str] = ()) -> None:
    """Refuse a file that cannot be written, before anything is computed.

    Parameters
    ----------
    option : str
        Such as ``--plot``.
    path : path
        Folders that it needs are made later.
    kinds : sequence of str
        The suffixes that it may have; any without it.

    Raises
    ------
    UserError
        Where the suffix is another one, the path is a folder, or a folder above it is no folder or
        may not be written to.
    """
    if kinds and path.suffix.lower() not in kinds:
        raise UserError(f"{option}={path}: give a name that ends in {' or '.join(kinds)}")
    if path.is_dir():
        raise UserError(f"{option}={path}: this is a folder; give the name of a file")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise UserError(f"{option}={path}: {folder.name} is a file and no folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UserError(f"{option}={path}: the folder {folder} may not be written to")

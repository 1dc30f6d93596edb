"""Types and checks of command-line arguments: lists of numbers, rotations and output files."""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from cyclopts import Parameter, Token

from nbv.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Command = TypeVar("Command", bound=Callable[..., Any])


def as_whole_number(_kind: Any, tokens: Sequence[Token]) -> int:
    """Return the integer of an option; other numbers are not rounded."""
    return int(_number(int, tokens[0].value))


def _number(kind: Callable[[str], float], text: str) -> float:
    try:
        return kind(text)
    except ValueError:
        what = "an integer" if kind is int else "a number"
        raise ValueError(f"{text!r} is not {what}") from None


def as_numbers(kind: Any, tokens: Sequence[Token]) -> list[Any]:
    """Return the numbers of an option, separated by commas or spaces; `kind` is a list type."""
    (kind_of_number,) = kind.__args__
    texts = [text for token in tokens for text in token.value.replace(",", " ").split()]
    if not texts:
        raise ValueError("give a number")
    return [_number(kind_of_number, text) for text in texts]


def as_rotations_or_file(_kind: Any, tokens: Sequence[Token]) -> list[float] | Path:
    """Return the numbers and ranges of an option, or the file that its only value names.

    A range ``a:b`` becomes the rotations from a in steps of a degree, and b.
    """
    if len(tokens) == 1 and tokens[0].value and not _is_numbers(tokens[0].value):
        return Path(tokens[0].value)
    rotations: list[float] = []
    for text in (text for token in tokens for text in token.value.replace(",", " ").split()):
        low, _, high = text.partition(":")
        first, last = _number(float, low), _number(float, high or low)
        if not 0 <= last - first <= 360:
            raise ValueError(f"{text!r}: give numbers, the lower first, and at most a full turn")
        rotations += [first + step for step in range(math.ceil(last - first))] + [last]
    return rotations


def _list_parameter(converter: Callable[..., Any], metavar: str) -> Parameter:
    return Parameter(converter=converter, n_tokens=1, negative=(), metavar=metavar)


Numbers = Annotated[list[float] | None, _list_parameter(as_numbers, "NUMBER...")]
# -z is an axis here and not an option.
FileAxis = Annotated[str, Parameter(allow_leading_hyphen=True)]
WholeNumbers = Annotated[list[int] | None, _list_parameter(as_numbers, "NUMBER...")]
WholeNumber = Annotated[int, Parameter(converter=as_whole_number, n_tokens=1, metavar="INT")]
_NUMBERS_OR_FILE = _list_parameter(as_rotations_or_file, "NUMBER...|FILE")
Estimate = Annotated[list[float] | Path, _NUMBERS_OR_FILE]
PoseSource = Annotated[list[float] | Path | None, _NUMBERS_OR_FILE]
Rotations = Annotated[
    list[float] | Path | None, _list_parameter(as_rotations_or_file, "NUMBER...|FROM:TO|FILE")
]

Json = Annotated[bool, Parameter(negative=(), help="Print JSON.")]
Format = Annotated[
    Literal["4x4", "quaternion", "pose-stamped", "json"] | None,
    Parameter(
        name="--format",
        help="Print the next camera pose in this form, and the answer as comments above it; json "
        "is --json, which wins over the others.",
    ),
]
BundleName = Annotated[str, Parameter(help="The name of a shipped bundle, or a file.")]
Followed = Annotated[
    bool,
    Parameter(
        negative="--not-followed",
        help="Whether a recommendation chose the last of several views. The expected error is then "
        "raised, because the same errors chose the view. Give --not-followed for a turntable or "
        "fixed cameras.",
    ),
]

AZIMUTHS, DISTRIBUTIONS, ORIENTATIONS = "azimuths", "distributions", "orientations"
FRAMES = "frames"
"""Kinds of content of a file or a table."""

SHIPPED = "mug"
"""The default bundle."""


def flag(name: str) -> str:
    """Return the flag of a field of options, or of a library's parameter."""
    return "--" + re.sub("_(deg|mm?|id)$", "", name).replace("_", "-")


def in_flags(message: str) -> str:
    """Return a library's message with its `parameters` replaced by flags."""
    return re.sub("`([a-z_]+)`", lambda match: flag(match[1]), message)


def as_paragraphs(command: Command) -> Command:
    """Return a command whose help has one line for each paragraph.

    Cyclopts wraps the lines of plain text, but also keeps the line breaks of the docstring.
    """
    joined: list[str] = []
    head, _, parameters = inspect.cleandoc(command.__doc__ or "").partition("\nParameters\n")
    for line in parameters.splitlines():
        if line.startswith(" ") and joined[-1].startswith(" "):
            joined[-1] += f" {line.strip()}"
        else:
            joined.append(line)
    paragraphs = (" ".join(paragraph.split()) for paragraph in head.split("\n\n"))
    described = ["", "Parameters", *joined] if joined else []
    command.__doc__ = "\n".join(["\n\n".join(paragraphs), *described])
    return command


Placement = tuple["NDArray[np.float64]", "list[float]", "list[float]", "str | None"]
"""Camera pose, point on the object's axis, direction of the axis, and name of the base frame."""


@as_paragraphs
@Parameter(name="*")
@dataclass(frozen=True)
class FrameOptions:
    """Options that say how frames are read.

    Parameters
    ----------
    intrinsics
        fx,fy,cx,cy in pixels, only the focal length, or a camera file (BOP, ROS CameraInfo). Give
        only the focal length for a frame that was cut out of a larger image.
    depth_scale
        Metres per unit of depth. Default: 1 for floating-point depth; for integer depth the value
        of the camera file, or 0.001.
    near
        Least depth of the object, metres.
    far
        Largest depth of the object, metres.
    mask_value
        The object's value in masks that are images of labels.
    """

    intrinsics: str | None = None
    depth_scale: float | None = None
    near: float | None = None
    far: float | None = None
    mask_value: float | None = None


@as_paragraphs
@Parameter(name="*")
@dataclass(frozen=True)
class MoveOptions:
    """Options that say where the camera is, and where it may go.

    Parameters
    ----------
    allowed
        Admissible rotations from the last view: degrees, ranges such as -60:60, or a .npy file of
        degrees or of n booleans, where entry k selects the rotation 360 k / n.
    max_travel
        Largest angle between the last view and the next, degrees.
    camera_pose
        The camera's pose at the last view, for which the target pose is printed too: the pose of
        the optical frame (x right, y down, z forward) in the base frame, metres; the 16 numbers of
        a 4 x 4 matrix, row by row, or a .txt, .npy, .json or .yaml file with it or a PoseStamped.
    axis
        The object's upright axis in the base frame: a point, metres, or a point and a direction, or
        a file with the object's pose, whose z axis it is. Default direction: 0 0 1.
    quaternion
        The order of the quaternion, xyzw or wxyz, in poses of 7 numbers: x y z, metres, and it.
    """

    allowed: Rotations = None
    max_travel: float = 180.0
    camera_pose: PoseSource = None
    axis: PoseSource = None
    quaternion: Literal["xyzw", "wxyz"] | None = None

    def allowed_deg(self) -> Any:
        """Return the rotations of ``--allowed``, read from a file if it names one."""
        from nbv.choice.moves import read_rotations

        return read_rotations(self.allowed) if isinstance(self.allowed, Path) else self.allowed

    def placement(self) -> Placement | None:
        """Return where camera and object are, if both are given.

        Raise UserError if only one is given, or is not a pose or an axis.
        """
        if self.camera_pose is None and self.axis is None:
            return None
        if self.camera_pose is None or self.axis is None:
            raise UserError("--camera-pose and --axis belong together; give both, or neither")
        from nbv.poses import read_pose

        camera = read_pose(self.camera_pose, self.quaternion)
        if isinstance(self.axis, Path):
            pose = read_pose(self.axis, self.quaternion).camera_pose
            return camera.camera_pose, pose[:3, 3].tolist(), pose[:3, 2].tolist(), camera.frame_id
        if len(self.axis) not in (3, 6):
            raise UserError(
                f"--axis has {len(self.axis)} numbers; give a point, or a point and a direction"
            )
        direction = self.axis[3:] or [0.0, 0.0, 1.0]
        return camera.camera_pose, self.axis[:3], direction, camera.frame_id


@as_paragraphs
@Parameter(name="*")
@dataclass(frozen=True)
class StopOptions:
    """Options that say when the pose is good enough; all that are given have to hold.

    Parameters
    ----------
    until
        The largest expected error, degrees.
    until_probability
        The least probability, 0 to 1, that the error is at most --within.
    within
        Degrees: 5, 15 or 30; any for orientations. Default: 15, or 25 for orientations.
    """

    until: float | None = None
    until_probability: float | None = None
    within: float | None = None


# Minus, hyphens and dashes that typesetting puts for the minus sign.
_MINUS = re.compile("[\u2010-\u2015\u2212\ufe63\uff0d]")

NUMBER_OPTIONS = (
    "--estimate",
    "--rotations",
    "--allowed",
    "--axis",
    "--camera-pose",
    "--gravity",
    "--views",
    "--intrinsics",
)


def joined_numbers(arguments: Sequence[str]) -> list[str]:
    """Return arguments in which the numbers after an option of `NUMBER_OPTIONS` are joined.

    The list ends at the first argument that is not a number, such as the frame in
    ``--rotations 0 90 frame.npy``. Typeset minus signs of numbers become ASCII ones.
    """
    joined: list[str] = []
    for given in arguments:
        argument = _with_ascii_minus(given)
        if joined and joined[-1].split("=")[0] in NUMBER_OPTIONS and _is_numbers(argument):
            joined[-1] += ("," if "=" in joined[-1] else "=") + argument
        else:
            joined.append(argument)
    return joined


def _with_ascii_minus(argument: str) -> str:
    """Return an argument with the minus signs of pages in its numbers, if it holds numbers."""
    option, equals, value = argument.rpartition("=")
    plain = _MINUS.sub("-", value)
    return option + equals + plain if _is_numbers(plain) else argument


def _is_numbers(text: str) -> bool:
    parts = re.sub(r"(?<=\d):(?=[-+.\d])", " ", text).replace(",", " ").split()
    try:
        return bool([float(part) for part in parts])
    except ValueError:
        return False


def check_options(given: Mapping[str, object], known: Sequence[str], of_what: str) -> None:
    """Raise UserError if an option is given, not None, that is not known for an input."""
    for name, value in given.items():
        if value is not None and name not in known:
            raise UserError(f"{flag(name)} does not go with {of_what}; leave it out")


def check_writable(option: str, path: Path, kinds: Sequence[str] = ()) -> None:
    """Check that the file of an option can be written, before anything is computed.

    Missing folders are made later. Without `kinds`, all suffixes are allowed. Raise UserError where
    the suffix is not allowed, the path is a folder, or its parent is a file or is not writable.
    """
    if kinds and path.suffix.lower() not in kinds:
        raise UserError(f"{option}={path}: give a name that ends in {' or '.join(kinds)}")
    if path.is_dir():
        raise UserError(f"{option}={path}: it is a folder; give the name of a file")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise UserError(f"{option}={path}: {folder.name} is a file; give a path in a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UserError(f"{option}={path}: the folder {folder} is not writable; give another one")

"""The figure of the study `rotations`: one object on the sphere of viewing directions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from nbv.core.rotation_criteria import view_angle_deg
from nbv.core.rotation_errors import OrientationErrors
from nbv.core.rotations import ASYMMETRIC, Orientations, Symmetry, viewing_direction
from nbv.robot.style import AGAINST, INK, MUTED, RC, method_style, new_figure
from studies.rotations import (
    Instance,
    calibration,
    chosen_views,
    others_of,
    read_instances,
    two_views,
)


@dataclass(frozen=True)
class Example:
    """A first view that is a flip, and the second view that `expected_error` takes.

    Attributes
    ----------
    one : Instance
    errors : OrientationErrors
        Of the object's other instances.
    first, second : int
        Images of the instance.
    error_deg : dict of str to float
        By method after the first view, posterior with scores.
    """

    one: Instance
    errors: OrientationErrors
    first: int
    second: int
    error_deg: Mapping[str, float]


def example(
    path: str | Path, symmetries: Mapping[str, Symmetry], settings: Mapping[str, Any]
) -> Example:
    """Return the example of a table of pairs, by a rule that knows nothing of second views.

    Of the objects that do not turn freely those of most flips, of these the instance of most flips,
    of that the first image that is a flip.
    """
    instances = read_instances(path, settings["objects"])
    able = [one for one in instances if others_of(one, instances)]
    symmetry = {one.object_id: symmetries.get(one.object_id, ASYMMETRIC) for one in able}
    error = {o.name: symmetry[o.object_id].distance_deg(o.estimate, o.truth) for o in able}
    is_flip = {name: angle > settings["flip_deg"] for name, angle in error.items()}

    def rank(one: Instance) -> tuple[bool, int, int]:
        of_object = sum(int(is_flip[o.name].sum()) for o in [one, *others_of(one, able)])
        return symmetry[one.object_id].axis is None, of_object, int(is_flip[one.name].sum())

    one = max(able, key=rank)
    scored = read_instances(path, settings["score_objects"])
    errors = calibration(others_of(one, instances), scored, symmetries, settings)
    found = two_views(one, errors, depends_on_view=True)
    i, chosen = int(np.argmax(is_flip[one.name])), chosen_views(found, "score")
    after = {name: float(found.error_deg["score"][i, k[i]].mean()) for name, k in chosen.items()}
    return Example(one, errors, i, int(chosen["bayes_error"][i, 0]), after)


# Light, so that marks of every colour stand out.
_SHADES = LinearSegmentedColormap.from_list("flips", ["#ffffff", "#c4b05c"])


@mpl.rc_context(RC)
def rotation_figure(shown: Example) -> Figure:
    """Draw where an example's images and the flips of its calibration are seen from."""
    one, errors, symmetry = shown.one, shown.errors, shown.errors.symmetry
    figure = new_figure(5.4, 4.3)
    axes = figure.add_subplot(projection="mollweide")
    edges = np.radians(np.arange(-180, 181, 2)), np.radians(np.arange(-90, 91, 2))
    x, y = np.meshgrid(*(edge[1:] - np.radians(1) for edge in edges))
    poses = np.zeros((x.size, 3, 3))  # Only the direction counts.
    across = np.cos(y)
    poses[:, 2] = -np.stack([across * np.cos(x), across * np.sin(x), np.sin(y)], -1).reshape(-1, 3)
    percent = 100 * errors.flip_probability(poses, "truth").reshape(x.shape)
    shades = axes.pcolormesh(*edges, percent, cmap=_SHADES, vmin=0, rasterized=True)
    label = "Probability of a flip, from calibration (%)"
    figure.colorbar(shades, orientation="horizontal", label=label, shrink=0.6, aspect=30)

    def mark(poses: Orientations, label: str, marker: str, size: float, **style: Any) -> None:
        x, y, z = viewing_direction(poses.reshape(-1, 3, 3)).T
        axes.plot(np.arctan2(y, x), np.arcsin(z), marker, label=label, markersize=size, **style)

    # Directions that the symmetry maps to each other look the same: a pair is of all of them.
    pairs = errors.truth[:, None] @ symmetry.discrete
    mark(pairs[~errors.is_flip], "calibration: right", ".", 3, color=MUTED)
    mark(pairs[errors.is_flip], "calibration: flip", "x", 4.5, color=AGAINST)
    is_flip = symmetry.distance_deg(one.estimate, one.truth) > errors.flip_deg
    image: Any = {"color": method_style("opposite", ()).color, "markerfacecolor": "none"}
    rest = ~np.isin(np.arange(len(is_flip)), [shown.first, shown.second])
    mark(one.truth[rest & ~is_flip], "image: right", "o", 5.5, **image)
    mark(one.truth[rest & is_flip], "image: flip", "X", 5.5, **image)
    move = one.truth[shown.second] @ one.truth[shown.first].T
    believed = symmetry.nearest(one.estimate[[shown.first]], one.truth[[shown.first]])
    chosen = method_style("expected_error", ())
    for name, i, at, marker, size, color in (
        ("first view", shown.first, believed, "*", 14, "#F0E442"),
        ("chosen view", shown.second, move @ believed, chosen.marker, 9, chosen.color),
    ):
        edge: Any = {"markeredgecolor": INK, "clip_on": False}
        mark(one.truth[[i]], name, marker, size, color=color, **edge)
        mark(at, "as estimated", marker, size, color="none", **edge)

    axes.set_xticks(np.radians([-120, -60, 0, 60, 120]), [""] * 5)
    axes.set_yticks(np.radians([-60, -30, 0, 30, 60]), ["−60°", "−30°", "0°", "30°", "60°"])
    axes.tick_params(labelsize=8, labelcolor=MUTED)
    figure.legend(loc="outside lower center", ncols=4, handlelength=1, columnspacing=1.2)
    single, after, other = (
        f"{shown.error_deg[name]:.1f}°" for name in ("single", "bayes_error", "random")
    )
    axes.set_title(
        f"Object {one.object_id} ({one.name}): one view errs by {single},\nwith the chosen second "
        f"one, {view_angle_deg(move[None])[0]:.0f}° away, {after}; with a random one {other}"
    )
    return figure

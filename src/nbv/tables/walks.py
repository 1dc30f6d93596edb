"""Walks over the calibration images of an instance: what further views of an object bring.

An image of an instance is a first view, and the other images of the same instance are the views
that can be reached. `nbv.OrientationTable.recommend`, calibrated on other instances, gives pose,
probability and decision after each view.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.choice.rotations import MIN_SEPARATION_DEG
from nbv.core.orientations.criteria import view_angle_deg
from nbv.core.orientations.group import Array, inverse
from nbv.core.seeds import rng_for
from nbv.data.depth_images import logged
from nbv.labels import number
from nbv.tables.next_camera import MOST_VIEWS, CameraMove, CameraRecommendation, PoseEstimate
from nbv.tables.orientation_table import OrientationTable

Order = Callable[[Sequence[CameraMove], Array, np.random.Generator], int]
"""Takes ranked moves, angles (n,) of candidates to the nearest view, and an rng; gives an index."""

ORDERS: dict[str, Order] = {
    "random": lambda moves, apart, rng: int(rng.choice(len(apart))),
    "opposite": lambda moves, apart, rng: int(apart.argmax()),
    "recommended": lambda moves, apart, rng: moves[0].index,
}
"""The next view at random, the farthest from all so far, and the product's."""

ENDED = "verdict != 'one more view'"
"""Query of the rows of walks at which the decision ends them."""

FIRST_VIEWS = 250
"""First views of a forecast: as many as a minute allows."""

FEWEST_OBJECTS, FEWEST_INSTANCES, N_RESAMPLES = 5, 3, 2000

LEVELS, LARGEST_BOUND_DEG = (80, 90), 90.0

NO_FORECAST = (
    f"what choosing saves is not known: that takes {FEWEST_OBJECTS} objects with "
    f"{FEWEST_INSTANCES} still instances each, told apart by scene_id and instance"
)

_ELSEWHERE = 50
"""Even candidates about the object, where an instance has no image left: for the pose alone."""


def walks(
    known: OrientationTable,
    images: OrientationTable,
    rng: np.random.Generator,
    orders: Mapping[str, Order] = ORDERS,
    firsts: Iterable[int] | None = None,
) -> Iterator[dict[str, Any]]:
    """Yield a row for each first view, order and number of views of an instance.

    `known` are pairs of other instances, `images` those of the instance, which stands still. The
    generator is for random orders; `firsts` are the first views, by default all images.
    """
    object_id, truth, score = images.object_ids[0], images.truth, images.score
    if score is not None and not np.isfinite(score).all():
        score = None
    cameras = np.tile(np.eye(4), (len(truth), 1, 1))
    cameras[:, :3, :3] = truth[0] @ inverse(truth)
    ahead = np.array([0.0, 0.0, 1.0])
    cameras[:, :3, 3] = ahead - cameras[:, :3, :3] @ ahead
    apart = np.stack([view_angle_deg(truth @ pose.T) for pose in truth])
    estimates = [
        PoseEstimate(rotation, 1000 * ahead, None if score is None else score[i], camera)
        for i, (rotation, camera) in enumerate(zip(images.estimate, cameras, strict=True))
    ]
    errors = known.errors(object_id)

    def free(taken: Sequence[int]) -> NDArray[np.intp]:
        return np.flatnonzero(apart[np.array(taken)].min(axis=0) >= MIN_SEPARATION_DEG)

    @cache
    def answer(taken: tuple[int, ...]) -> CameraRecommendation:
        left = free(taken)
        candidates = list(cameras[left]) if len(left) else _ELSEWHERE
        return known.recommend([estimates[i] for i in taken], candidates, object_id=object_id)

    for first in range(len(truth)) if firsts is None else firsts:
        for name, order in orders.items():
            taken: tuple[int, ...] = (first,)
            while True:
                after = answer(taken)
                last = taken[-1]
                error = errors.symmetry.distance_deg(after.rotation, truth[last])
                ratio = 1.0
                if score is not None and errors.ratio is not None:
                    ratio = float(errors.ratio([score[last]])[0])
                yield {
                    "first": first,
                    "order": name,
                    "n_views": len(taken),
                    "error_deg": float(error),
                    "expected_deg": after.expected_error_deg,
                    "probability": after.probability(after.STOP_WITHIN_DEG),
                    "flip_ratio": ratio,
                    "verdict": after.decision.verdict,
                    "depends_on_view": after.depends_on_view,
                }
                left = free(taken)
                if len(taken) == MOST_VIEWS or not len(left):
                    break
                to_nearest = apart[np.array(taken)][:, left].min(axis=0)
                taken = (*taken, int(left[order(after.moves, to_nearest, rng)]))


def stopped(walks: pd.DataFrame, rule: str) -> pd.DataFrame:
    """Return the row of each walk at which it stops: the first that is enough, else the last."""
    walk = ["instance", "first", "order"]
    if "training" in walks:
        walk.append("training")
    # Rows are in the order of views.
    last = walks.groupby(walk, sort=False).tail(1)
    return pd.concat([walks.query(rule), last]).groupby(walk, sort=False).head(1)


@dataclass(frozen=True)
class Forecast:
    """What choosing a view, and stopping, are expected to save.

    Attributes
    ----------
    error_deg : dict of str to float
        Mean error after one view; after a second one, random, opposite or recommended; and where
        the decision ends the recommended order (``stopped``).
    mean_views : float
        Number of views at which the decision ends.
    choosing_deg, stopping_deg : tuple of float
        What a recommended second view saves over a random one, and the decision over stopping at
        random after the same mean number of views, each with its 95 % interval.
    bounds_deg : dict of str to dict
        `bounds_of` the errors of one random image an object, after one view and ``stopped``.
    """

    error_deg: dict[str, float]
    mean_views: float
    choosing_deg: tuple[float, float, float]
    stopping_deg: tuple[float, float, float]
    bounds_deg: dict[str, dict[str, float]]

    @property
    def sentence(self) -> str:
        """What is expected, in a sentence."""
        stopping = f"stopping, after {self.mean_views:.1f} views on average,"
        parts = []
        for what, other, (mean, low, high) in (
            ("choosing", "a random second view", self.choosing_deg),
            (stopping, "stopping at random after as many", self.stopping_deg),
        ):
            saved = f"{number(mean, 1)}° ({number(low, 1)} to {number(high, 1)})"
            if low > 0:
                parts.append(f"{what} is expected to save {saved} over {other}")
            else:
                parts.append(f"{what} is not shown to save anything over {other}: {saved}")
        return "; ".join(parts)


def forecast(table: OrientationTable) -> Forecast | None:
    """Return what walks over a table's images bring, each instance calibrated by all others.

    Figures are means over objects of means over instances, from random first views; intervals
    resample objects, then instances. It takes up to a minute.

    Parameters
    ----------
    table : OrientationTable
        Groups named scene/instance are instances.

    Returns
    -------
    Forecast or None
        None with fewer than `FEWEST_OBJECTS` objects of `FEWEST_INSTANCES` instances.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> pose = np.eye(3)[None]
    >>> table = nbv.OrientationTable(np.array(["mug"]), np.array(["1/1"]), pose, pose)
    >>> nbv.forecast(table) is None
    True
    """
    instances = pd.Series(table.group).str.contains("/").to_numpy()
    n_instances = pd.Series(table.group[instances]).groupby(table.object_id[instances]).nunique()
    names = n_instances.index[n_instances >= FEWEST_INSTANCES]
    if len(names) < FEWEST_OBJECTS:
        return None
    rows: list[dict[str, Any]] = []
    for name in logged(names, len(names), "objects"):
        rng = rng_for(0, "forecast", name)
        images = np.flatnonzero(instances & (table.object_id == name))
        firsts = rng.permutation(images)[: max(1, FIRST_VIEWS // len(names))]
        for group in np.unique(table.group[firsts]):
            is_instance = (table.object_id == name) & (table.group == group)
            members = np.flatnonzero(is_instance)
            seen = np.flatnonzero(np.isin(members, firsts))
            about = {"object_id": name, "instance": f"{name}/{group}"}
            of = table.where(~is_instance), table.where(is_instance), rng
            rows += [
                about | row | {"is_drawn": members[row["first"]] == firsts[0]}
                for row in walks(*of, firsts=seen)
            ]
    frame = pd.DataFrame(rows)
    drawn = frame[frame["is_drawn"] & (frame["order"] == "recommended")]

    def figures(order: str, rule: str) -> pd.DataFrame:
        ends = stopped(frame[frame["order"] == order], rule)
        return ends.groupby(["object_id", "instance"])[["error_deg", "n_views"]].mean()

    rng, ended = rng_for(0, "forecast"), figures("recommended", ENDED)
    mean_views, *_ = _resampled(ended["n_views"], rng)
    numbers = range(1, MOST_VIEWS + 1)
    curve = [figures("recommended", f"n_views == {n}")["error_deg"] for n in numbers]
    chance = [np.interp(mean_views, numbers, each) for each in zip(*curve, strict=True)]
    after = {"one view": curve[0]}
    after |= {order: figures(order, "n_views == 2")["error_deg"] for order in ORDERS}
    after["stopped"] = ended["error_deg"]
    return Forecast(
        {name: _resampled(errors, rng)[0] for name, errors in after.items()},
        mean_views,
        _resampled(after["random"] - after["recommended"], rng),
        _resampled(chance - after["stopped"], rng),
        {
            "one view": bounds_of(drawn[drawn["n_views"] == 1]["error_deg"]),
            "stopped": bounds_of(stopped(drawn, ENDED)["error_deg"]),
        },
    )


def bounds_of(error_deg: ArrayLike, largest_deg: float = LARGEST_BOUND_DEG) -> dict[str, float]:
    """Return bounds on a further error by `LEVELS`, percent: split conformal prediction.

    Of n errors (n,) and a further one in random order, the ceil((n + 1) q)-th smallest is not
    exceeded with a probability of q or more. A level is left out if n is too small for it, or its
    bound exceeds `largest_deg`.
    """
    ordered = np.sort(error_deg)
    ranks = {level: -(-(len(ordered) + 1) * level // 100) for level in LEVELS}
    found = {str(q): float(ordered[k - 1]) for q, k in ranks.items() if k <= len(ordered)}
    return {level: bound for level, bound in found.items() if bound <= largest_deg}


def _resampled(values: pd.Series[float], rng: np.random.Generator) -> tuple[float, float, float]:
    """Return the mean over objects of the means over instances, and its interval."""
    objects = [of.to_numpy() for _, of in values.groupby(level="object_id")]
    drawn = rng.integers(len(objects), size=(N_RESAMPLES, len(objects)))
    samples = np.zeros(len(drawn))
    for k, of in enumerate(objects):
        instances = of[rng.integers(len(of), size=(*drawn.shape, len(of)))]
        samples += ((drawn == k) * instances.mean(axis=2)).mean(axis=1)
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(np.mean([of.mean() for of in objects])), float(low), float(high)

"""Compare what a table of orientations promises with the exact risk of synthetic estimators.

    python tools/promised_errors.py --pairs 40 200 --draws 200 > promised_errors.csv

An object without symmetry is seen straight ahead, in poses uniform on SO(3). The estimate of a pose
R is R D E. E is a small error, a rotation vector of normal components of 2 degrees. D is the
identity, or a flip on the object's axes; its probability depends on the direction from which the
object is seen (`KINDS`). A score is logistic(z), z normal with variance 1 and mean 0, or minus a
shift where the estimate is a flip (`SHIFTS`). A draw has new calibration pairs, 10 an instance, and
one first estimate. Rows compare promises of `nbv.OrientationTable.recommend` with what came:

one view     before a move: the error of the answer's pose
recommended  expected before the recommended move, of the pose after it
there        expected after that move, given the second estimate
random       expected before a random admissible move, of the pose after it

What came is the exact risk given the first estimate S and its score, but for sampling: the true
pose is S E' D', weighted by the probability of its flip there and by the score's density. All flips
in both views are taken with their probabilities; small errors, flips to anywhere and the second
score (stratified) are drawn. The product fuses both views. `ratio` is came / promised, each the
mean over draws, with a 95 % interval by resampling draws; further columns are shares of decisions.

    python tools/promised_errors.py --bounds 9 19 --draws 500 > bounds.csv

compares bounds of tables of so many objects with errors on a new instance of one of them. Objects
have 3 instances, and flips of a random kind. Shares are of all draws, with bounds above 90° too.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import expit, logit, ndtri

from nbv import OrientationTable, PoseEstimate
from nbv.core.orientations.group import ASYMMETRIC, Array, Orientations, inverse, viewing_direction
from nbv.core.seeds import rng_for
from nbv.tables.walks import ENDED, LARGEST_BOUND_DEG, ORDERS, bounds_of, stopped, walks

Generator = np.random.Generator
Flips = NDArray[np.intp]

SMALL_DEG = 2.0
SIDE_DEG = 60.0
"""A side is all directions within this angle of its centre."""
N_CANDIDATES = 50
N_IN_GROUP = 10
N_SMALL = 200
"""Small errors for each kind of flip, in the risk of one view."""
N_SECOND = 2
"""Scores and small errors of the second view, for each pair of flips."""
RAREST = 1e-4
"""Second estimates of a smaller share are left out."""
POSITION_MM = np.array([0.0, 0.0, 700.0])
N_RESAMPLES = 2000


class Flip(NamedTuple):
    """A kind of flip: rotation vector (None: to anywhere), and probabilities by direction."""

    rotation_deg: tuple[float, float, float] | None
    from_side: float
    elsewhere: float
    centre: tuple[float, float, float] = (1.0, 0.0, 0.0)


HALF, QUARTER = (0.0, 0.0, 180.0), (90.0, 0.0, 0.0)
KINDS: dict[str, tuple[Flip, ...]] = {
    "none": (),
    "anywhere": (Flip(None, 0.2, 0.2),),
    "everywhere": (Flip(HALF, 0.2, 0.2),),
    "quarters": tuple(Flip((0.0, 0.0, k * 90.0), 0.2 / 3, 0.2 / 3) for k in (1, 2, 3)),
    "side": (Flip(HALF, 0.6, 0.0),),
    "two": (Flip(HALF, 0.6, 0.03), Flip(QUARTER, 0.6, 0.03, (-1.0, 0.0, 0.0))),
}
SHIFTS = {"no scores": None, "nothing": 0.0, "little": 1.0, "much": 3.0}


@dataclass(frozen=True)
class Estimator:
    """A synthetic estimator. Its flips count from 1; 0 is no flip."""

    flips: tuple[Flip, ...]
    shift: float | None

    def chances(self, poses: Orientations) -> Array:
        """Return the probability of each flip, (n, 1 + flips), for true poses (n, 3, 3)."""
        chances = np.empty((len(poses), 1 + len(self.flips)))
        for j, flip in enumerate(self.flips, start=1):
            from_side = viewing_direction(poses) @ flip.centre > np.cos(np.radians(SIDE_DEG))
            chances[:, j] = np.where(from_side, flip.from_side, flip.elsewhere)
        chances[:, 0] = 1 - chances[:, 1:].sum(axis=1)
        return chances

    def errors(self, flips: Flips, rng: Generator) -> Orientations:
        """Return D E (n, 3, 3) for flips (n,)."""
        errors = Rotation.random(len(flips), rng=rng).as_matrix()
        for j, vector in enumerate([np.zeros(3), *(flip.rotation_deg for flip in self.flips)]):
            if vector is not None:
                errors[flips == j] = Rotation.from_rotvec(vector, degrees=True).as_matrix()
        small = rng.normal(0.0, SMALL_DEG, (len(flips), 3))
        return np.asarray(errors @ Rotation.from_rotvec(small, degrees=True).as_matrix())

    def scores(self, flips: Flips, quantile: Array) -> Array | None:
        """Return the scores (n,) at their quantiles (n,), for flips (n,)."""
        if self.shift is None:
            return None
        return np.asarray(expit(ndtri(quantile) - self.shift * (flips > 0)))

    def table(self, n: int, rng: Generator) -> OrientationTable:
        """Return a table of `n` new pairs."""
        truth = np.asarray(Rotation.random(n, rng=rng).as_matrix())
        flips = (rng.uniform(size=(n, 1)) > self.chances(truth).cumsum(axis=1)).sum(axis=1)
        groups = np.array([f"instance {i // N_IN_GROUP}" for i in range(n)])
        scores = self.scores(flips, rng.uniform(size=n))
        estimate = truth @ self.errors(flips, rng)
        return OrientationTable(np.array(["object"] * n), groups, estimate, truth, scores)

    def truths(
        self, first: PoseEstimate, flips: Flips, rng: Generator
    ) -> tuple[Orientations, Array]:
        """Return possible true poses (n, 3, 3) after the first estimate, and their weights (n,)."""
        truth = first.rotation @ inverse(self.errors(flips, rng))
        weights = self.chances(truth)[np.arange(len(flips)), flips]
        if self.shift is not None and first.score is not None:
            density = np.exp(-self.shift * logit(first.score) - self.shift**2 / 2)
            weights = weights * np.where(flips > 0, density, 1.0)
        return truth, weights

    def after(
        self, table: OrientationTable, first: PoseEstimate, pose: Array, rng: Generator
    ) -> Array:
        """Return the mean promise after a second view, and the risk, (2,) in degrees."""
        each = range(1 + len(self.flips))
        flips, second, stratum = np.array([*itertools.product(each, each, range(N_SECOND))]).T
        truth, weights = self.truths(first, flips, rng)
        truth = pose[:3, :3].T @ truth
        weights = weights * self.chances(truth)[np.arange(len(flips)), second]
        scores = self.scores(second, (stratum + rng.uniform(size=len(flips))) / N_SECOND)
        estimates = truth @ self.errors(second, rng)
        likely = np.flatnonzero(weights > RAREST * weights.sum())
        answers = [
            table.recommend([first, seen(estimates, scores, pose, int(i))], 2) for i in likely
        ]
        came = ASYMMETRIC.distance_deg(truth[likely], np.stack([each.rotation for each in answers]))
        promised = [each.expected_error_deg for each in answers]
        return np.average([promised, came], axis=1, weights=weights[likely])


def seen(estimates: Orientations, scores: Array | None, pose: Array, i: int = 0) -> PoseEstimate:
    """Return one of some estimates."""
    score = None if scores is None else float(scores[i])
    return PoseEstimate(estimates[i], POSITION_MM, score, pose)


def rows_of(kind: str, scores: str, n: int, draw: int, seed: int) -> list[dict[str, Any]]:
    """Return promises and risks of one draw of `n` pairs; another version has the same draws."""
    estimator = Estimator(KINDS[kind], SHIFTS[scores])
    rngs = {
        use: rng_for(seed, kind, scores, n, draw, use)
        for use in ("pairs", "one view", "recommended", "random")
    }
    table = estimator.table(n, rngs["pairs"])
    image = estimator.table(1, rngs["pairs"])
    first = seen(image.estimate, image.score, np.eye(4))
    answer = table.recommend([first], N_CANDIDATES)
    flips = np.repeat(np.arange(1 + len(estimator.flips)), N_SMALL)
    truth, weights = estimator.truths(first, flips, rngs["one view"])
    risk = np.average(ASYMMETRIC.distance_deg(truth, answer.rotation), weights=weights)
    found = {"one view": (answer.expected_error_deg, float(risk))}
    moves = sorted(answer.moves, key=lambda move: move.index)
    chosen = {"recommended": answer.moves[0], "random": moves[rngs["random"].integers(len(moves))]}
    for view, move in chosen.items():
        pose = np.asarray(move.target_camera_pose)
        there, risk = estimator.after(table, first, pose, rngs[view]).tolist()
        found[view] = move.expected_error_deg, risk
        if view == "recommended":
            found["there"] = there, risk
    verdict = getattr(getattr(answer, "decision", None), "verdict", None)
    about = {"kind": kind, "scores": scores, "n_pairs": n, "draw": draw, "verdict": verdict}
    return [
        about | {"view": view, "promised_deg": promised, "came_deg": came}
        for view, (promised, came) in found.items()
    ]


def bounds_hold(n: int, draw: int, seed: int) -> list[dict[str, Any]]:
    """Return whether the bounds of one draw of `n` objects are given, and hold."""
    rng = rng_for(seed, "bounds", n, draw)
    estimators = [Estimator(KINDS[k], SHIFTS["little"]) for k in rng.choice(list(KINDS), n)]

    def pairs(k: int, n_instances: int) -> OrientationTable:
        table = estimators[k].table(n_instances * N_IN_GROUP, rng)
        return replace(table, object_id=np.full(len(table.group), str(k)))

    objects = [pairs(k, 3) for k in range(n)]
    names = ("object_id", "group", "estimate", "truth", "score")
    known = OrientationTable(
        *(np.concatenate([getattr(table, name) for table in objects]) for name in names)
    )

    def errors(known: OrientationTable, images: OrientationTable) -> tuple[float, float]:
        first = rng.integers(len(images.group))
        order = {"recommended": ORDERS["recommended"]}
        walk = pd.DataFrame(walks(known, images, rng, order, [first])).assign(instance="")
        return walk["error_deg"][0], stopped(walk, ENDED)["error_deg"].iloc[0]

    calibration = []
    for table in objects:
        is_drawn = known.object_id == table.object_id[0]
        is_drawn &= known.group == rng.choice(table.group)
        calibration.append(errors(known.where(~is_drawn), known.where(is_drawn)))
    came = errors(known, pairs(int(rng.integers(n)), 1))
    rows = []
    for stage, of_stage, error in zip(
        ("one view", "stopped"), np.transpose(calibration), came, strict=True
    ):
        for level, bound in bounds_of(of_stage, 180.0).items():
            holds = {"given": bound <= LARGEST_BOUND_DEG, "holds": error <= bound}
            rows.append({"n_objects": n, "stage": stage, "level": level} | holds)
    return rows


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return mean promises and risks for each kind of estimator, and for all."""
    found = []
    names = ["n_pairs", "kind", "scores", "view"]
    every = pd.concat([rows, rows.assign(kind="all", scores="all")])
    for values, part in every.groupby(names, sort=False):
        pairs = part[["promised_deg", "came_deg"]].to_numpy()
        drawn = np.random.default_rng(0).integers(len(pairs), size=(N_RESAMPLES, len(pairs)))
        means = pairs[drawn].mean(axis=1)
        low, high = np.quantile(means[:, 1] / means[:, 0], [0.025, 0.975])
        promised, came = pairs.mean(axis=0)
        about = dict(zip(names, values, strict=True))
        about |= {"n_draws": len(pairs), "promised_deg": promised, "came_deg": came}
        about |= {"ratio": came / promised, "ratio_low": low, "ratio_high": high}
        found.append(about | part["verdict"].value_counts(normalize=True).to_dict())
    return pd.DataFrame(found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--scores", nargs="+", choices=SHIFTS, default=list(SHIFTS))
    parser.add_argument("--pairs", nargs="+", type=int, default=[40, 200, 2000])
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--bounds", nargs="+", type=int)
    given = parser.parse_args()
    rows = []
    if given.bounds:
        for draw, n in itertools.product(range(given.draws), given.bounds):
            rows += bounds_hold(n, draw, given.seed)
        found = pd.DataFrame(rows)
        found["given_holds"] = found["holds"].where(found["given"]).astype(float)
        means = found.groupby(["n_objects", "stage", "level"]).mean()
        means.to_csv(sys.stdout, float_format="%.3f")
        return
    for draw in range(given.draws):
        for n, kind, scores in itertools.product(given.pairs, given.kinds, given.scores):
            if KINDS[kind] or scores == given.scores[0]:
                rows += rows_of(kind, scores, n, draw, given.seed)
        sys.stderr.write(f"{draw + 1} of {given.draws} draws\n")
    summary(pd.DataFrame(rows)).to_csv(sys.stdout, index=False, float_format="%.3f")


if __name__ == "__main__":
    main()

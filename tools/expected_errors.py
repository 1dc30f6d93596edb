"""Compare what a bundle promises with what happens, on fresh objects before its own camera.

    python tools/expected_errors.py mug --objects 7000 > expected_errors.csv

Objects are generated (`--seed`), or those of `--meshes` (ShapeNetCore) that `--exclude` does not
list. Each is turned once at an elevation from 0 to 60 degrees, with everything that is random in
training, and the sensor's noise always. From a few first views, the recommended second and third
ones are taken. A row has the mean promise and the mean error, for the thirds of the promises as
well, with 95 % intervals by resampling objects; "before" a view is taken, and "after" it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.bundles.recommender import Recommender
from nbv.choice.next_view import N_KEPT, after_rotations, next_view
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.seeds import rng_for
from nbv.data.camera import Camera
from nbv.data.meshes import Surface
from nbv.data.randomisation import Randomisation, randomised_sweep
from nbv.data.render import open_renderer
from nbv.data.sensors import build_sensor
from nbv.data.sources import open_source
from nbv.experiment.config import load_config

CONFIG = Path(__file__).parents[1] / "config"
SETTINGS = ("experiment=bundles", "estimator=classifier", "randomisation=camera", "sensor=kinect")
HIGHEST_DEG = 60.0
N_FRAMES = 72
"""Views of a turn, 5 degrees apart, from which the nearest to a recommended one is taken."""
FIRST_VIEWS = 3
WITHIN = "5"
N_RESAMPLES = 2000


@cache
def tools_of(bundle: str, overrides: tuple[str, ...], seed: int) -> tuple[Any, ...]:
    """Return what all objects share; once for each process."""
    config = load_config(CONFIG, [*SETTINGS, *overrides])
    recommender = Recommender.load(bundle)
    own = recommender.bundle
    calibrated = after_rotations(own.distributions, own.object_ids, max(N_KEPT, own.n_bins // 2))
    sensor = build_sensor(config["sensor"]["name"], config["sensor"]["parameters"])
    renderer = open_renderer(config["renderer"]["name"])
    return config, recommender, calibrated, sensor, renderer, open_source(config["dataset"], seed)


def rows_of(
    object_id: str, bundle: str, overrides: tuple[str, ...], seed: int
) -> list[dict[str, Any]]:
    """Return promises and errors from each first view of one object."""
    config, recommender, calibrated, sensor, renderer, source = tools_of(bundle, overrides, seed)
    own = recommender.bundle
    mesh: Surface = source.load(own.category, object_id)
    rng = rng_for(seed, "expected errors", object_id)
    azimuths_deg = np.arange(N_FRAMES) * (360.0 / N_FRAMES)
    codes = randomised_sweep(
        mesh,
        rng.uniform(0.0, HIGHEST_DEG),
        azimuths_deg,
        Camera(**config["camera"]),
        renderer,
        sensor,
        config["sensor"]["diagonal_m"][own.category],
        replace(Randomisation(**config["randomisation"]), measured=1.0, elevation_deg=0.0),
        rng,
    )
    views = recommender.distributions(codes)

    def from_view(first: int) -> Iterator[dict[str, Any]]:
        taken, answer = [first], None
        for n_views in (1, 2, 3):
            before = answer
            rotations = [float((place - first) % N_FRAMES) * 360.0 / N_FRAMES for place in taken]
            answer = next_view(views[taken], rotations, calibrated, own.affinity)
            error = float(circular_distance_deg(answer.azimuth_deg, azimuths_deg[taken[-1]]))
            promised = {"after": (answer.expected_error_deg, answer.probability_within[WITHIN])}
            if before is not None:
                move = before.move
                promised["before"] = (move.expected_error_deg, move.probability_within[WITHIN])
            for when, (error_deg, chance) in promised.items():
                yield {
                    "object_id": object_id,
                    "n_views": n_views,
                    "when": when,
                    "promised_deg": error_deg,
                    "error_deg": error,
                    "promised_within": chance,
                    "within": float(error <= float(WITHIN)),
                    "bayes_factor": answer.bayes_factor,
                }
            turned = azimuths_deg[taken[-1]] + answer.move.rotation_deg
            apart = circular_distance_deg(azimuths_deg, turned)
            apart[taken] = np.inf
            taken.append(int(apart.argmin()))

    firsts = rng.choice(N_FRAMES, FIRST_VIEWS, replace=False).tolist()
    return [row for first in firsts for row in from_view(first)]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return mean promises and errors, for all rows and for thirds by the promised error."""
    found = []
    for (n_views, when), part in rows.groupby(["n_views", "when"]):
        third = pd.qcut(part["promised_deg"].rank(method="first"), 3, labels=False)
        groups = {"all": part} | {f"third {k + 1}": part[third == k] for k in range(3)}
        for name, group in groups.items():
            names = ["promised_deg", "error_deg", "promised_within", "within"]
            sums = group.groupby("object_id")[names].sum().to_numpy()
            counts = group.groupby("object_id").size().to_numpy()
            rng = np.random.default_rng(0)
            drawn = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), N_RESAMPLES)
            means = (drawn @ sums) / (drawn @ counts)[:, None]
            low, high = np.quantile(means[:, 0] / means[:, 1], [0.025, 0.975])
            mean = dict(zip(names, sums.sum(axis=0) / counts.sum(), strict=True))
            ratio = mean["promised_deg"] / mean["error_deg"]
            about = {"n_views": n_views, "when": when, "group": name, "n_objects": len(sums)}
            found.append(about | mean | {"ratio": ratio, "ratio_low": low, "ratio_high": high})
    return pd.DataFrame(found)


def main() -> None:
    """Print the table; write the rows if a file is given."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("bundle")
    parser.add_argument("--objects", type=int, default=7000)
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--meshes", help="ShapeNetCore, instead of generated objects")
    parser.add_argument("--exclude", help="file of objects to leave out")
    parser.add_argument(
        "--overrides", nargs="*", default=[], help="settings: randomisation.hole=0 …"
    )
    parser.add_argument("--rows", type=Path, help="CSV of every promise and error")
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    overrides: tuple[str, ...] = tuple(given.overrides)
    category = Recommender.load(given.bundle).bundle.category
    if given.meshes:
        overrides += ("dataset=shapenet", f"dataset.root={given.meshes}", "n_objects=null")
        overrides += (f"dataset.exclude_file={given.exclude}",) if given.exclude else ()
        names = tools_of(given.bundle, overrides, given.seed)[-1].object_ids(category)
    else:
        names = [f"{category}-{index:04d}" for index in range(given.objects)]
    one = partial(rows_of, bundle=given.bundle, overrides=overrides, seed=given.seed)
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(given.cores) as pool:
        for done, rows in enumerate(pool.map(one, names, chunksize=8), start=1):
            found += rows
            if done % 200 == 0:
                sys.stderr.write(f"{done} of {len(names)} objects\n")
    frame = pd.DataFrame(found)
    if given.rows:
        frame.to_csv(given.rows, index=False)
    summary(frame).to_csv(sys.stdout, index=False, float_format="%.3f")


if __name__ == "__main__":
    main()

"""Print what `nbv calibrate` brings: calibrate_draws.py IMAGES BUNDLE... > calibrate.csv.

IMAGES is the folder of depth images of the workflow, such as results/<name>/bundles/depth/mug, with
those of ShapeNet's mugs at all elevations. See docs/turntable.md, calibrate.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.data.depth_images import open_depth
from nbv.experiment.make_bundle import turns_of
from nbv.robot.bundle import Bundle
from nbv.robot.calibration import DENSITY, recalibrated
from nbv.robot.evaluation import OPPOSITE, baselines, follow, recommended, seen_by
from nbv.robot.next_view import after_rotations
from nbv.robot.recommender import Recommender
from nbv.robot.sweeps import Turn

N_DRAWS = 13
N_CALIBRATING = (1, 2, 5, 20)
N_EVALUATED = 20
TURNS_OF_EACH = 2
EVERY = 15
"""Of 360 views, as on a turntable."""

ONE_DENSITY = {**DENSITY, "bandwidths_deg": [8], "pseudo_observations": [10]}
"""The paper's tables, which are not evaluated here, are made soon with one."""


def errors_of(bundle: Bundle, turns: Sequence[Turn]) -> dict[str, float]:
    """Return the MAE of one view, of two with the recommended one, and with the opposite one."""
    calibrated = after_rotations(bundle.distributions, bundle.object_ids)
    opposite = baselines(2, 0.0, np.random.default_rng(0))[OPPOSITE]
    found = []
    for turn in turns:
        seen = seen_by(bundle, turn)
        errors = np.abs(follow(seen, recommended(calibrated, seen, bundle.affinity), 2))
        after_opposite = np.abs(follow(seen, opposite, 2)[:, 1])
        found.append((*errors.mean(axis=0), after_opposite.mean()))
    return dict(zip(("one_view", "recommended", "opposite"), np.mean(found, axis=0), strict=True))


def draws(bundle: Bundle, of_object: Mapping[str, Sequence[Turn]]) -> Iterator[dict[str, float]]:
    """Yield errors without and with calibration, for each draw of mugs and number of them."""
    for draw in range(N_DRAWS):
        rng = np.random.default_rng(draw)
        ids = rng.permutation(list(of_object)).tolist()
        evaluated = [turn for name in ids[:N_EVALUATED] for turn in of_object[name]]
        own = errors_of(bundle, evaluated)
        calibrating = [
            of_object[name][place]
            for name in ids[N_EVALUATED : N_EVALUATED + max(N_CALIBRATING)]
            for place in rng.permutation(len(of_object[name]))[:TURNS_OF_EACH]
        ]
        for n_mugs in N_CALIBRATING:
            own_turns = calibrating[: TURNS_OF_EACH * n_mugs]
            calibrated = recalibrated(bundle, own_turns, "a draw", ONE_DENSITY)
            after = errors_of(calibrated, evaluated)
            yield (
                {"draw": draw, "mugs": n_mugs}
                | own
                | {f"{name}_calibrated": error for name, error in after.items()}
            )


def main() -> None:
    """Print a table of all bundles, draws and numbers of mugs that calibrate."""
    folder, *names = sys.argv[1:]
    files = sorted(Path(folder).glob("el*.npy"))
    images = [open_depth(file, file.with_name(f"{file.stem}_objects.json")) for file in files]
    elevations = [float(file.stem.removeprefix("el")) for file in files]
    tables = []
    for seed, name in enumerate(names):
        recommender = Recommender.load(name, "numpy")
        ids = images[0].object_ids
        turns, *_ = turns_of(recommender.network, images, elevations, ids, EVERY)
        of_object: dict[str, list[Turn]] = {object_id: [] for object_id in ids}
        for turn in turns:
            # The elevation is not given.
            of_object[turn.object_id].append(replace(turn, elevation_deg=float("nan")))
        rows = pd.DataFrame(draws(recommender.bundle, of_object))
        rows.insert(0, "seed", seed)
        tables.append(rows)
    pd.concat(tables).to_csv(sys.stdout, index=False, float_format="%.3f")


if __name__ == "__main__":
    main()

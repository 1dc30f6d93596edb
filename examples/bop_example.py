"""A small example in BOP's form: ``python examples/bop_example.py FOLDER``.

The object looks the same after a rotation by 180° but for a mark on one side. An estimator that
does not see the mark takes the wrong pose half of the time, and its score is lower.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from nbv.core.orientations.group import Orientations, viewing_direction
from nbv.files import write_text

N_SCENES, N_IMAGES = 4, 40
HALF_TURN = np.diag([-1.0, -1.0, 1.0])


def write_example(folder: str | Path) -> None:
    """Write results.csv, scene_gt.json of each scene, models_info.json and estimate.json."""
    from scipy.spatial.transform import Rotation

    folder, rng = Path(folder), np.random.default_rng(0)
    lines = ["scene_id,im_id,obj_id,score,R,t,time"]
    shift = np.array([10.0, -20.0, 700.0])
    for scene in range(1, N_SCENES + 1):
        truth = Rotation.random(N_IMAGES, random_state=scene).as_matrix()
        estimate, score = _estimates(truth, rng)
        known = {}
        for image in range(N_IMAGES):
            row = truth[image].ravel().tolist()
            known[str(image)] = [{"obj_id": 1, "cam_R_m2c": row, "cam_t_m2c": shift.tolist()}]
            r, t = (" ".join(f"{x:.6f}" for x in a.ravel()) for a in (estimate[image], shift))
            lines.append(f"{scene},{image},1,{score[image]:.4f},{r},{t},-1")
        write_text(folder / f"{scene:06d}" / "scene_gt.json", json.dumps(known))
    write_text(folder / "results.csv", "\n".join(lines) + "\n")
    write_text(folder / "models_info.json", json.dumps({"1": {"diameter": 100.0}}))
    # Seen from the back, where both poses look the same.
    seen = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    pose = (seen @ HALF_TURN).ravel().tolist()
    view = {"R": pose, "t": shift.tolist(), "score": 0.4}
    write_text(folder / "estimate.json", json.dumps(view))


def _estimates(truth: Orientations, rng: np.random.Generator) -> tuple[Orientations, Orientations]:
    from scipy.spatial.transform import Rotation

    small = Rotation.from_rotvec(rng.normal(0, 1.5, (len(truth), 3)), degrees=True).as_matrix()
    hidden = viewing_direction(truth)[:, 0] < 0
    flips = hidden & (rng.random(len(truth)) < 0.5)
    estimate = truth @ small @ np.where(flips[:, None, None], HALF_TURN, np.eye(3))
    return estimate, np.where(hidden, 0.4, 0.9) + rng.normal(0, 0.1, len(truth)).clip(-0.3, 0.1)


if __name__ == "__main__":
    write_example(sys.argv[1])

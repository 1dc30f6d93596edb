"""A small example in BOP's form and as 4 × 4 matrices: ``python examples/bop_example.py FOLDER``.

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
    """Write BOP's files, the same poses below ob_in_cam and truth, and what a robot knows.

    BOP's are results.csv, scene_gt.json of each scene and models_info.json. The robot knows an
    estimate (estimate.json) and its camera's pose (camera_pose.txt).
    """
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
            file = f"{scene:06d}/{image:06d}.txt"
            _write_matrix(folder / "ob_in_cam" / file, estimate[image], shift / 1000)
            _write_matrix(folder / "truth" / file, truth[image], shift / 1000)
        write_text(folder / f"{scene:06d}" / "scene_gt.json", json.dumps(known))
    write_text(folder / "results.csv", "\n".join(lines) + "\n")
    write_text(folder / "models_info.json", json.dumps({"1": {"diameter": 100.0}}))
    # Seen from the back, where both poses look the same.
    seen = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    pose = (seen @ HALF_TURN).ravel().tolist()
    view = {"R": pose, "t": shift.tolist(), "score": 0.4}
    write_text(folder / "estimate.json", json.dumps(view))
    ahead = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    _write_matrix(folder / "camera_pose.txt", ahead, np.array([-0.2, 0.0, 0.5]))


def _write_matrix(path: Path, rotation: Orientations, position_m: Orientations) -> None:
    """Write a 4 × 4 matrix as FoundationPose does, with ``numpy.savetxt``."""
    rows = [*np.column_stack([rotation, position_m]), [0.0, 0.0, 0.0, 1.0]]
    write_text(path, "\n".join(" ".join(f"{x:.9f}" for x in row) for row in rows) + "\n")


def _estimates(truth: Orientations, rng: np.random.Generator) -> tuple[Orientations, Orientations]:
    from scipy.spatial.transform import Rotation

    small = Rotation.from_rotvec(rng.normal(0, 1.5, (len(truth), 3)), degrees=True).as_matrix()
    hidden = viewing_direction(truth)[:, 0] < 0
    flips = hidden & (rng.random(len(truth)) < 0.5)
    estimate = truth @ small @ np.where(flips[:, None, None], HALF_TURN, np.eye(3))
    return estimate, np.where(hidden, 0.4, 0.9) + rng.normal(0, 0.1, len(truth)).clip(-0.3, 0.1)


if __name__ == "__main__":
    write_example(sys.argv[1])

"""From a depth frame in memory to the next view, and from the start of `nbv` to its answer."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from nbv.bundles.bundle import Bundle
from nbv.bundles.recommender import Recommender, bundle_path
from nbv.experiment.estimation.hardware import use_one_thread
from nbv.experiment.estimation.networks import build_network
from nbv.frames.synthetic import Frame, example_frame
from nbv.labels import counted
from performance.figures import Figure, Target
from performance.timing import take_turns

ONE = Target(1.0, at_most=True)
# Of the forward pass with torch, over all images of a frame: crop, network, fusion and choice.
FORWARD = Target(1.5, at_most=True)
FRAME_MS = 2.0
START_S = 1.0
HELP_S = 0.3
IN_A_ROW = 20

_START = """
import sys, numpy as np
from nbv.bundles.recommender import Recommender
answer = Recommender.load("mug").recommend(np.load(sys.argv[1]))
assert "torch" not in sys.modules
"""


def run(quick: bool) -> list[Figure]:
    use_one_thread()
    bundle = Bundle.load(bundle_path("mug"))
    frame = example_frame()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "frame.npy")
        np.save(path, frame.depth_m)
        n_rounds = 2 if quick else 40
        return [*_in_memory(bundle, frame, n_rounds), *_starts(path, 1 if quick else 7)]


def _in_memory(bundle: Bundle, frame: Frame, n_rounds: int) -> list[Figure]:
    network = build_network(dict(bundle.estimator), bundle.camera.image_side).eval()
    side = bundle.camera.image_side
    # A crop, and its mirror image where the bundle averages both.
    n_images = 1 if bundle.mirror_plane_deg is None else 2
    ready = torch.zeros((n_images, 1, side, side))

    def forward() -> None:
        with torch.inference_mode():
            network(ready)

    recommender = Recommender(bundle)

    def answer() -> None:
        recommender.recommend(frame.depth_m, mask=frame.mask, intrinsics=frame.intrinsics)

    # In turn, they push each other out of the processor's cache.
    times = take_turns([answer, forward], n_rounds, in_a_row=IN_A_ROW)
    ms, forward_ms = (1e3 * times.typical(column) for column in (0, 1))
    detail = f"{n_rounds} times {IN_A_ROW} frames of 640 × 480 in a row, one thread"
    of_torch = f"{forward_ms:.2f} ms for {counted(n_images, 'image')} with torch"
    return [
        Figure(
            "frame to next view / forward pass",
            times.ratio(0, 1),
            FORWARD,
            f"{ms:.2f} ms against {of_torch}; {detail}",
        ),
        Figure(
            f"frame to next view / {FRAME_MS:g} ms", ms / FRAME_MS, ONE, f"{ms:.2f} ms; {detail}"
        ),
    ]


def _starts(frame: Path, n_rounds: int) -> list[Figure]:
    def start(*arguments: str) -> Callable[[], object]:
        return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True)

    help_ = start("-c", "import sys; from nbv.cli import run; sys.argv[1:] = ['--help']; run()")
    times = take_turns([start("-c", _START, str(frame)), help_], n_rounds)
    bounds = {"start to answer": START_S, "nbv --help": HELP_S}
    return [
        Figure(
            f"{name} / {bound:g} s",
            times.typical(column) / bound,
            ONE,
            f"{times.typical(column):.2f} s; {n_rounds} starts",
        )
        for column, (name, bound) in enumerate(bounds.items())
    ]

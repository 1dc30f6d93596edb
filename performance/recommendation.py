"""One recommendation from a depth image in memory, against the network's forward pass alone."""

from __future__ import annotations

import time

import numpy as np
import torch
from numpy.typing import NDArray

from nbv.core.evidence import gather_evidence
from nbv.core.lookup import build_lookup
from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth
from nbv.data.normalisation import normalise
from nbv.data.procedural import generate
from nbv.data.renderers import open_renderer
from nbv.experiment.estimation.hardware import Hardware, choose_hardware, to_input, use_one_thread
from nbv.experiment.estimation.inference import estimate_azimuth
from nbv.experiment.estimation.networks import build_network
from nbv.experiment.estimation.weights import Estimator
from performance.figures import Figure, Target
from performance.lookup import calibration_estimates
from performance.settings import configuration
from performance.timing import median_ratio

TARGET = Target(1.3, at_most=True)


def run(quick: bool) -> list[Figure]:
    use_one_thread()
    camera = Camera()
    settings = configuration()["estimator"]
    hardware = choose_hardware("cpu", settings["precision"])
    torch.manual_seed(0)
    network = build_network(settings, camera.image_side).eval()
    estimator = Estimator(network, settings, camera.image_side, [])
    table = build_lookup(
        gather_evidence(
            calibration_estimates(20, 360),
            configuration()["density"],
            bandwidth_deg=8.0,
            pseudo_observations=30.0,
        ),
        "pose_ambiguity",
    )
    mug = normalise(generate("mug", 0, 0), "+z", "+x", 0.0, "box")
    depth = open_renderer("embree").render(mug.vertices, mug.faces, 0.0, [40.0], camera)
    ready = to_input(encode_depth(depth, camera), hardware)

    def recommend() -> None:
        estimate_deg = estimate_azimuth(estimator, encode_depth(depth, camera), hardware)
        table.recommend(estimate_deg)

    def forward() -> None:
        with torch.inference_mode(), hardware.autocast():
            network(ready)

    blocks, calls = (2, 50) if quick else (15, 300)
    for _ in range(50):
        recommend()
        forward()
    spent = np.empty((blocks, calls, 2))
    for block in range(blocks):
        for call in range(calls):
            for column, work in enumerate((recommend, forward)):
                start = time.perf_counter()
                work()
                spent[block, call, column] = time.perf_counter() - start
    return [
        _figure(spent, name, q, hardware) for name, q in (("median", 50), ("99th percentile", 99))
    ]


def _figure(spent: NDArray[np.float64], name: str, percentile: int, hardware: Hardware) -> Figure:
    by_block = np.percentile(spent, percentile, axis=1)
    ms = 1e3 * np.median(by_block, axis=0)
    detail = (
        f"{ms[0]:.3f} ms against {ms[1]:.3f} ms ({hardware}, one thread); {spent.shape[0]} blocks "
        f"of {spent.shape[1]} calls of each in turn"
    )
    ratio = median_ratio(by_block[:, 0], by_block[:, 1])
    return Figure(f"recommendation / forward pass, {name}", ratio, TARGET, detail)

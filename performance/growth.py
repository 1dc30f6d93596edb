"""How cost grows with objects, bins and pixels: the exponents, fitted on logarithmic axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from nbv.core.evidence import gather_evidence
from nbv.core.lookup import build_lookup
from nbv.core.selection import chosen_lookup
from nbv.data.camera import Camera
from nbv.data.renderers import open_renderer
from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
from nbv.experiment.estimation.training import train_network
from performance.figures import Figure
from performance.lookup import calibration_estimates
from performance.settings import configuration
from performance.solids import object_with_faces
from performance.timing import Work, growth_exponent, take_turns
from performance.training import bare_steps, random_codes

N_VIEWS = 360


def run(quick: bool) -> list[Figure]:
    use_one_thread()
    few = quick
    return [
        _figure("training", "objects", (1, 2) if few else (5, 10, 20), _training, quick),
        _figure("lookup, chosen", "objects", (10, 20) if few else (10, 20, 40), _chosen, quick),
        _figure("lookup", "bins", (90, 180) if few else (180, 360, 720), _lookup, quick),
        _figure("rendering", "image side", (32, 64) if few else (32, 64, 128), _rendering, quick),
        _figure("training step", "image side", (32, 64) if few else (32, 64, 128), _step, quick),
    ]


def _figure(
    what: str, of: str, sizes: Sequence[int], work_for: Callable[[int], Work], quick: bool
) -> Figure:
    turns = take_turns([work_for(size) for size in sizes], 1 if quick else 3)
    exponent = growth_exponent(sizes, turns)
    times = ", ".join(f"{size}: {turns.typical(i):.3g} s" for i, size in enumerate(sizes))
    return Figure(f"growth of {what} with {of}", exponent, None, f"{in_words(exponent)} ({times})")


def in_words(exponent: float) -> str:
    """Say what twice the size costs."""
    nearest = round(exponent)
    if abs(exponent) < 0.15:
        law = "does not grow"
    elif abs(exponent - nearest) < 0.15:
        law = {1: "proportional", 2: "quadratic", 3: "cubic"}.get(nearest, f"power {nearest}")
    else:
        law = f"power {exponent:.1f}"
    return f"{law}: twice the size takes {2**exponent:.1f} times as long"


def _training(n_objects: int) -> Work:
    settings = {**configuration()["estimator"], "epochs": 1}
    hardware = choose_hardware("cpu", settings["precision"])
    codes = random_codes(n_objects * N_VIEWS, 64).reshape(n_objects, N_VIEWS, 64, 64)
    return lambda: train_network(codes, settings, hardware, seed=0)


def _step(side: int) -> Work:
    settings = {**configuration()["estimator"], "batch_size": 64}
    hardware = choose_hardware("cpu", settings["precision"])
    return bare_steps(settings, hardware, side, 5)


def _chosen(n_objects: int) -> Work:
    estimate_deg = calibration_estimates(n_objects, N_VIEWS)
    return lambda: chosen_lookup(estimate_deg, "pose_ambiguity", configuration()["density"])


def _lookup(n_bins: int) -> Work:
    estimate_deg = calibration_estimates(20, N_VIEWS)
    return lambda: build_lookup(
        gather_evidence(
            estimate_deg,
            configuration()["density"],
            bandwidth_deg=8.0,
            pseudo_observations=30.0,
            n_bins=n_bins,
        ),
        "pose_ambiguity",
    )


def _rendering(side: int) -> Work:
    mesh = object_with_faces("mug", 10_000)
    renderer, camera = open_renderer("embree"), Camera(image_side=side)
    azimuths_deg = np.arange(N_VIEWS, dtype=float)
    return lambda: renderer.render(mesh.vertices, mesh.faces, 0.0, azimuths_deg, camera)

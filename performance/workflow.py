"""What the paper run cost and how busy it kept its cores, from its table of running times."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.config import read_configuration
from nbv.config.memory import training_objects
from nbv.errors import UserError
from nbv.estimation.hardware import choose_hardware, use_one_thread
from nbv.files import read_csv
from nbv.layout import Layout
from nbv.reporting.runtime import efficiency
from performance.figures import Figure, Target
from performance.settings import ROOT
from performance.training import N_VIEWS, bare_steps

BUSY, BUSY_TARGET = "workflow: processor time / (cores × wall)", Target(0.90)
COST = "workflow: processor time / bare steps"
# By estimator.warm_start. Random weights take 1.17; the others 0.70 and 0.55 of that.
COST_TARGETS = {
    "none": Target(1.2, at_most=True),
    "elevations": Target(0.82, at_most=True),
    "categories": Target(0.64, at_most=True),
    "both": Target(0.64, at_most=True),
}


def run(quick: bool) -> list[Figure]:
    results = ROOT / "results" / "paper"
    return [utilisation(results), cost(results, 20 if quick else 200)]


def utilisation(results: Path) -> Figure:
    """Return the share of the cores' time that jobs computed for, as far as it is known.

    Processor times are known where jobs wrote them to their logs. Where some are only Snakemake's
    last samples, which lack up to 30 s of a job, the share is a lower bound: a figure if it reaches
    the target, and otherwise none.
    """
    runtime = _runtime(results)
    if runtime.empty:
        return _not_run(BUSY, BUSY_TARGET, results)
    total = runtime.iloc[-1]
    share = efficiency(runtime)
    sampled, cores = int(total["sampled_jobs"]), int(total["side_by_side"])
    available_s = cores * total["elapsed_s"]
    detail = (
        f"{total['cpu_s']:,.0f} s in {total['jobs']} jobs on {cores} cores in "
        f"{total['elapsed_s']:,.0f} s, for {total['wall_s'] / available_s:.0%} of which they ran"
    )
    if not sampled:
        return Figure(BUSY, share, BUSY_TARGET, detail)
    detail = f"processor times of {sampled} jobs are incomplete; {detail}"
    if BUSY_TARGET.holds(share):
        return Figure(BUSY, share, BUSY_TARGET, f"at least: {detail}")
    return Figure(BUSY, None, BUSY_TARGET, f"at least {share:.2f}: {detail}")


def cost(results: Path, n_steps: int) -> Figure:
    """Return the run's processor time over that of the bare steps of its schedule.

    The schedule is that of ``estimator.warm_start=none``: `estimator.epochs` from random weights
    for every estimator. A step is timed now, on this machine, where the run has to be made too, and
    in as many processes at once as the run had jobs: they slow each other, bare or not.
    """
    runtime = _runtime(results)
    if runtime.empty:
        return _not_run(COST, None, results)
    try:
        settings = read_configuration(results, ("categories", "elevations_deg", "n_objects"))
        target = COST_TARGETS[settings["estimator"].get("warm_start", "none")]
        steps = steps_from_random_weights(settings)
    except UserError as error:
        return Figure(COST, None, None, f"{error}")
    total = runtime.iloc[-1]
    cpu_s, at_once = float(total["cpu_s"]), int(total["side_by_side"])
    step_s = _step_seconds(settings, n_steps, at_once)
    detail = f"{cpu_s:,.0f} s against {steps:,} steps of {1e3 * step_s:.1f} ms, {at_once} at once"
    return Figure(COST, cpu_s / (steps * step_s), target, detail)


def steps_from_random_weights(settings: Mapping[str, Any]) -> int:
    """Return the steps of all estimators of a configuration, each from random weights.

    Raises
    ------
    UserError
        Where the configuration does not say how many objects there are.
    """
    if settings["n_objects"] is None:
        raise UserError("not measured: n_objects is null")
    estimator = settings["estimator"]
    n_images = N_VIEWS * training_objects(settings, settings["n_objects"])
    n_units = sum(len(settings["elevations_deg"][name]) for name in settings["categories"])
    batches = max(n_images // estimator["batch_size"], 1)
    n_estimators: int = n_units * settings["n_folds"]
    return n_estimators * int(estimator["epochs"]) * batches


def _step_seconds(settings: Mapping[str, Any], n_steps: int, at_once: int) -> float:
    """Return the processor time of one bare step, of several processes that take them at once."""
    with ProcessPoolExecutor(at_once, mp_context=get_context("spawn")) as processes:
        each = processes.map(_own_step_seconds, [settings] * at_once, [n_steps] * at_once)
        return float(np.mean(list(each)))


def _own_step_seconds(settings: Mapping[str, Any], n_steps: int) -> float:
    """Return the processor time of one bare step: the median of five turns."""
    use_one_thread()
    estimator = settings["estimator"]
    hardware = choose_hardware("cpu", estimator["precision"])
    work = bare_steps(estimator, hardware, settings["camera"]["image_side"], n_steps)
    work()
    turns = []
    for _ in range(5):
        started = time.process_time()
        work()
        turns.append((time.process_time() - started) / n_steps)
    return float(np.median(turns))


def _runtime(results: Path) -> pd.DataFrame:
    table = Path(Layout(str(results)).table("runtime", "csv"))
    return read_csv(table) if table.is_file() else pd.DataFrame()


def _not_run(name: str, target: Target | None, results: Path) -> Figure:
    return Figure(name, None, target, f"not run: {results.name} is not finished; make reproduce")

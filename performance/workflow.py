"""What the paper run cost and how busy it kept its cores, from its table of running times."""

from __future__ import annotations

import re
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.errors import UserError
from nbv.experiment.config import read_configuration
from nbv.experiment.config.memory import training_objects
from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
from nbv.experiment.estimation.training import STEPS_TAKEN
from nbv.experiment.layout import Layout
from nbv.experiment.report.runtime import efficiency
from nbv.files import read_csv
from performance.figures import Figure, Target
from performance.settings import ROOT
from performance.training import N_VIEWS, bare_and_own

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
    return [utilisation(results), cost(results, *((3, 1) if quick else (20, 5)))]


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


def cost(results: Path, n_objects: int, n_rounds: int) -> Figure:
    """Return the run's processor time over that of the bare steps of its schedule.

    The schedule is that of ``estimator.warm_start=none``: `estimator.epochs` from random weights
    for every estimator. A bare step's time is that of the run's own steps, times bare over own.
    Only this quotient is measured now, in pairs and in as many processes at once as the run had
    jobs: a machine's speed changes more between the run and now than this ratio may. The set-up of
    the paired trainings counts as theirs, which makes the ratio about 0.5 % too large.

    Parameters
    ----------
    results : Path
        Of the run.
    n_objects, n_rounds : int
        Of the trainings that are paired with bare steps, in each process.
    """
    runtime = _runtime(results)
    if runtime.empty:
        return _not_run(COST, None, results)
    try:
        settings = read_configuration(results, ("categories", "elevations_deg", "n_objects"))
        target = COST_TARGETS[settings["estimator"].get("warm_start", "none")]
        steps = steps_from_random_weights(settings)
        own_s = _own_step_s(Path(Layout(str(results)).logs))
    except UserError as error:
        return Figure(COST, None, None, f"{error}")
    total = runtime.iloc[-1]
    cpu_s, at_once = float(total["cpu_s"]), int(total["side_by_side"])
    share = _bare_over_own(settings, n_objects, n_rounds, at_once)
    step_s = share * own_s
    detail = (
        f"{cpu_s:,.0f} s against {steps:,} steps of {1e3 * step_s:.2f} ms; the run's took "
        f"{1e3 * own_s:.2f} ms, and bare ones {share:.3f} of it, {at_once} at once"
    )
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


def _own_step_s(logs: Path) -> float:
    """Return the processor time of a training step of a run, by what its trainings logged."""
    pattern = re.escape(STEPS_TAKEN).replace("%d", r"(\d+)").replace(r"%\.2f", r"([\d.]+)")
    texts = (path.read_text(encoding="utf-8") for path in sorted(logs.glob("train/**/*.log")))
    told = [found.groups() for text in texts if (found := re.search(pattern, text))]
    if not told:
        raise UserError(f"not measured: the trainings in {logs} tell no processor time")
    steps, seconds = np.array(told, dtype=float).sum(axis=0)
    return float(seconds / steps)


def _bare_over_own(
    settings: Mapping[str, Any], n_objects: int, n_rounds: int, at_once: int
) -> float:
    """Return the time of a bare step over that of an own one, in several processes at once."""
    with ProcessPoolExecutor(at_once, mp_context=get_context("spawn")) as processes:
        given = (settings, n_objects, n_rounds)
        each = processes.map(_pairs, *([argument] * at_once for argument in given))
        return float(np.mean(list(each)))


def _pairs(settings: Mapping[str, Any], n_objects: int, n_rounds: int) -> float:
    use_one_thread()
    estimator = {**settings["estimator"], "epochs": 1}
    hardware = choose_hardware("cpu", estimator["precision"])
    side = settings["camera"]["image_side"]
    return bare_and_own(estimator, hardware, side, n_objects, n_rounds).ratio(0, 1)


def _runtime(results: Path) -> pd.DataFrame:
    table = Path(Layout(str(results)).table("runtime", "csv"))
    return read_csv(table) if table.is_file() else pd.DataFrame()


def _not_run(name: str, target: Target | None, results: Path) -> Figure:
    return Figure(name, None, target, f"not run: {results.name} is not finished; make reproduce")

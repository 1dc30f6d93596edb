"""What finished runs cost, from their tables of running times: make reproduce and make quick."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from nbv.experiment.report.runtime import efficiency
from nbv.files import read_csv
from performance.figures import Figure, Target
from performance.settings import ROOT

BUSY, BUSY_TARGET = "workflow: processor time / (cores × wall)", Target(0.90)


RENDERS_AND_LOOKUPS = "quick run / its renders and lookups"
FITS, FITS_TARGET = "linear estimators / networks: processor time", Target(0.15, at_most=True)
ERRORS, ERRORS_TARGET = "linear estimators / networks: error of one view", Target(1.0, at_most=True)


def run(quick: bool) -> list[Figure]:
    results = ROOT / "results"
    of_paper, of_quick = results / "paper", results / "quick"
    return [utilisation(of_paper), shared_work(of_quick), *linear_estimators(of_quick, of_paper)]


def shared_work(results: Path) -> Figure:
    """Return the processor time of a run, as a multiple of its renders' and lookup tables'."""
    spent = _processor_s(results)
    if not spent:
        return Figure(RENDERS_AND_LOOKUPS, None, None, f"not run: {results.name}; make quick")
    ratio = spent["all"] / (spent["render"] + spent["lookup"])
    return Figure(RENDERS_AND_LOOKUPS, ratio, None, f"{spent['all']:,.0f} s in all")


def linear_estimators(linear: Path, networks: Path) -> list[Figure]:
    """Return what the linear estimators of one run cost, and err, against another's networks."""
    fits, trainings = _processor_s(linear), _processor_s(networks)
    if not fits or not trainings:
        missing = "not run: make quick and make reproduce"
        names = {FITS: FITS_TARGET, ERRORS: ERRORS_TARGET}
        return [Figure(name, None, target, missing) for name, target in names.items()]
    times = fits["extract"] + fits["fit"], trainings["train"]
    errors = [_single_error_deg(results) for results in (linear, networks)]
    return [
        Figure(FITS, times[0] / times[1], FITS_TARGET, f"{times[0]:,.0f} and {times[1]:,.0f} s"),
        Figure(
            ERRORS,
            errors[0] / errors[1],
            ERRORS_TARGET,
            f"{errors[0]:.2f} and {errors[1]:.2f} degrees, mean over the categories",
        ),
    ]


def _processor_s(results: Path) -> dict[str, float]:
    runtime = _runtime(results)
    return {} if runtime.empty else dict(zip(runtime["rule"], runtime["cpu_s"], strict=True))


def _single_error_deg(results: Path) -> float:
    cells = read_csv(results / "tables/table1.csv")
    return float(cells.query("method == 'single' and metric == 'mae'")["value"].mean())


def utilisation(results: Path) -> Figure:
    """Return the share of the cores' time that jobs computed for, as far as it is known.

    Processor times are known where jobs wrote them to their logs. Where some are only Snakemake's
    last samples, which lack up to 30 s of a job, the share is a lower bound: a figure if it reaches
    the target, and otherwise none.
    """
    runtime = _runtime(results)
    if runtime.empty:
        detail = f"not run: {results.name} is not finished; make reproduce"
        return Figure(BUSY, None, BUSY_TARGET, detail)
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


def _runtime(results: Path) -> pd.DataFrame:
    table = results / "tables/runtime.csv"
    return read_csv(table) if table.is_file() else pd.DataFrame()

"""How busy the paper's run kept its cores, from its table of running times."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from nbv.experiment.report.runtime import efficiency
from nbv.files import read_csv
from performance.figures import Figure, Target
from performance.settings import ROOT

BUSY, BUSY_TARGET = "workflow: processor time / (cores × wall)", Target(0.90)


def run(quick: bool) -> list[Figure]:
    return [utilisation(ROOT / "results" / "paper")]


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

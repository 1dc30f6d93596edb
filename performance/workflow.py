"""How busy the paper run kept its cores, from its table of running times; nothing is run."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from nbv.files import read_csv
from nbv.layout import Layout
from nbv.reporting.runtime import efficiency
from performance.figures import Figure, Target
from performance.settings import ROOT

NAME, TARGET = "workflow: processor time / (cores × wall)", Target(0.90)


def run(quick: bool) -> list[Figure]:
    return [utilisation(ROOT / "results" / "paper")]


def utilisation(results: Path) -> Figure:
    """Return the share of the cores' time that jobs computed for, as far as it is known.

    Processor times are known where jobs wrote them to their logs. Where some are only Snakemake's
    last samples, which lack up to 30 s of a job, the share is a lower bound: a figure if it reaches
    the target, and otherwise none.
    """
    table = Path(Layout(str(results)).table("runtime", "csv"))
    runtime = read_csv(table) if table.is_file() else pd.DataFrame()
    if runtime.empty:
        return Figure(
            NAME, None, TARGET, f"not run: {results.name} is not finished; make reproduce"
        )
    total = runtime.iloc[-1]
    share = efficiency(runtime)
    sampled, cores = int(total["sampled_jobs"]), int(total["side_by_side"])
    available_s = cores * total["elapsed_s"]
    detail = (
        f"{total['cpu_s']:,.0f} s in {total['jobs']} jobs on {cores} cores in "
        f"{total['elapsed_s']:,.0f} s, for {total['wall_s'] / available_s:.0%} of which they ran"
    )
    if not sampled:
        return Figure(NAME, share, TARGET, detail)
    detail = f"processor times of {sampled} jobs are incomplete; {detail}"
    if TARGET.holds(share):
        return Figure(NAME, share, TARGET, f"at least: {detail}")
    return Figure(NAME, None, TARGET, f"at least {share:.2f}: {detail}")

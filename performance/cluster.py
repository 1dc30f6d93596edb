"""How long a run takes on a cluster: ``python -m performance.cluster --help``.

Not a benchmark: it adds up what a reference run measured for each rule (``runtime.csv``), in the
order in which ``profiles/slurm`` sends jobs. What it leaves out is said in ``docs/cluster.md``.
"""

from __future__ import annotations

import argparse
import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

REFERENCE = Path(__file__).parents[1] / "docs/reference/paper/runtime.csv"
# The run that `REFERENCE` measured.
REFERENCE_CATEGORIES, REFERENCE_UNITS = 5, 10
OF_FOLD = ("train", "estimate", "lookup", "evaluate_baselines", "evaluate_recommended")
OF_CATEGORIES = ("table", "figure")


@dataclass(frozen=True)
class Size:
    """What a run is made of; every category has the same elevations."""

    categories: int
    elevations: int
    folds: int

    @property
    def units(self) -> int:
        """Return how many categories at an elevation there are."""
        return self.categories * self.elevations


@dataclass(frozen=True)
class Costs:
    """Seconds of one job as it is sent to the cluster, and between two that follow each other."""

    data_s: float
    fold_s: float
    report_s: float
    notice_s: float


def costs(
    size: Size, measured: Mapping[str, tuple[int, float]], start_s: float, notice_s: float
) -> Costs:
    """Add up the rules of each group of ``profiles/slurm``.

    Parameters
    ----------
    size : Size
    measured : mapping of str to (int, float)
        Jobs and their wall-clock seconds in all, by rule, of the reference run.
    start_s : float
        Seconds that Snakemake needs to start in a job of the cluster.
    notice_s : float
        Seconds until Snakemake sees that a job has ended.

    Returns
    -------
    Costs
        Tables and figures count in proportion to the categories, claims to the units: at most so
        much, because some of them show one category alone.
    """
    one = {rule: wall_s / jobs for rule, (jobs, wall_s) in measured.items()}
    whole = {rule: wall_s for rule, (_, wall_s) in measured.items()}
    growth = size.categories / REFERENCE_CATEGORIES
    return Costs(
        data_s=start_s + one["meshes"] + one["splits"] + size.elevations * one["render"],
        fold_s=start_s + sum(one[rule] for rule in OF_FOLD),
        report_s=start_s
        + whole["settings"]
        + growth * sum(whole[rule] for rule in OF_CATEGORIES)
        + whole["claims"] * size.units / REFERENCE_UNITS,
        notice_s=notice_s,
    )


def makespan_s(size: Size, cost: Costs, cores: int) -> float:
    """Return the seconds from the first job's start to the last one's end.

    Each core takes the next job in the queue: first the data of every category, then each fold as
    soon as the data of its category are there, then the report.
    """
    free_at_s = [0.0] * cores
    ready_at_s = []
    for _ in range(size.categories):
        ended_s = heapq.heappop(free_at_s) + cost.data_s
        heapq.heappush(free_at_s, ended_s)
        ready_at_s += [ended_s + cost.notice_s] * (size.elevations * size.folds)
    last_s = 0.0
    for ready_s in ready_at_s:
        ended_s = max(heapq.heappop(free_at_s), ready_s) + cost.fold_s
        heapq.heappush(free_at_s, ended_s)
        last_s = max(last_s, ended_s)
    return last_s + cost.notice_s + cost.report_s


def work_s(size: Size, cost: Costs) -> float:
    """Return the seconds of all cores together."""
    folds = size.units * size.folds
    return size.categories * cost.data_s + folds * cost.fold_s + cost.report_s


def critical_path_s(cost: Costs) -> float:
    """Return the seconds that no number of cores goes below."""
    return cost.data_s + cost.fold_s + cost.report_s + 2 * cost.notice_s


def load_measured(path: Path) -> dict[str, tuple[int, float]]:
    """Read jobs and wall-clock seconds by rule from the ``runtime.csv`` of a run."""
    table = pd.read_csv(path).set_index("rule")
    return {str(rule): (int(row.jobs), float(row.wall_s)) for rule, row in table.iterrows()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the time on each number of nodes."""
    parser = argparse.ArgumentParser(prog="python -m performance.cluster", description=__doc__)
    parser.add_argument("--categories", type=int, default=55)
    parser.add_argument("--elevations", type=int, default=6, help="of each category")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--nodes", type=int, nargs="+", default=[1, 10, 100])
    parser.add_argument("--cores", type=int, default=16, help="of a node, at one job each")
    parser.add_argument("--start-s", type=float, default=14.0, help="Snakemake's start in a job")
    parser.add_argument(
        "--notice-s", type=float, default=30.0, help="until Snakemake sees that a job has ended"
    )
    parser.add_argument("--runtime", type=Path, default=REFERENCE, help="of the paper's run")
    options = parser.parse_args(arguments)
    size = Size(options.categories, options.elevations, options.folds)
    cost = costs(size, load_measured(options.runtime), options.start_s, options.notice_s)
    jobs = size.categories + size.units * size.folds + 1
    print(
        f"{size.units} units, {jobs} jobs, {work_s(size, cost) / 3600:.1f} core-hours; "
        f"critical path {critical_path_s(cost) / 60:.1f} min"
    )
    for nodes in options.nodes:
        minutes = makespan_s(size, cost, nodes * options.cores) / 60
        print(f"{nodes} nodes of {options.cores} cores: {minutes:.1f} min")


if __name__ == "__main__":
    main()

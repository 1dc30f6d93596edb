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
from typing import Any

from nbv.experiment.config import read_configuration
from nbv.experiment.report.runtime import load_measured

REFERENCE = Path(__file__).parents[1] / "docs/reference/paper"
OF_UNIT = ("lookup", "evaluate_baselines", "evaluate_recommended")
OF_CATEGORIES = ("table", "figure")


@dataclass(frozen=True)
class Size:
    """What a run is made of.

    Attributes
    ----------
    elevations : tuple of int
        Of each category.
    folds : int
    """

    elevations: tuple[int, ...]
    folds: int

    @property
    def units(self) -> int:
        """Return how many categories at an elevation there are."""
        return sum(self.elevations)

    @property
    def jobs(self) -> int:
        """Return how many jobs are sent: data and folds of each category, and the report."""
        return len(self.elevations) * (1 + self.folds) + 1


@dataclass(frozen=True)
class Costs:
    """Seconds of the parts of jobs, and between two jobs that follow each other.

    Attributes
    ----------
    start_s : float
        Of Snakemake in each job of the cluster.
    category_s, elevation_s : float
        Data of a category, and of each of its elevations.
    lowest_s, next_s : float
        Of a fold, from its training to its errors: the lowest elevation, and each further one.
    report_s : float
    notice_s : float
        Until Snakemake sees that a job has ended.
    """

    start_s: float
    category_s: float
    elevation_s: float
    lowest_s: float
    next_s: float
    report_s: float
    notice_s: float

    def data_s(self, elevations: int) -> float:
        """Return the seconds of the job that makes the data of a category."""
        return self.start_s + self.category_s + elevations * self.elevation_s

    def fold_s(self, elevations: int) -> float:
        """Return the seconds of the job of a fold, whose elevations start from one another."""
        return self.start_s + self.lowest_s + (elevations - 1) * self.next_s


def costs(
    size: Size,
    measured: Mapping[str, tuple[int, float]],
    reference: Mapping[str, Any],
    start_s: float,
    notice_s: float,
) -> Costs:
    """Add up the rules of each group of ``profiles/slurm``.

    Parameters
    ----------
    size : Size
    measured : mapping of str to (int, float)
        Jobs and their wall-clock seconds in all, by rule, of the reference run.
    reference : mapping
        Its configuration. Trainings take time in proportion to their epochs.
    start_s, notice_s : float
        See `Costs`.

    Returns
    -------
    Costs
        Tables and figures count in proportion to the categories, claims to the units: at most so
        much, because some of them show one category alone.
    """
    one = {rule: wall_s / jobs for rule, (jobs, wall_s) in measured.items()}
    whole = {rule: wall_s for rule, (_, wall_s) in measured.items()}
    known = reference_size(reference)
    estimator = reference["estimator"]
    first, then = estimator["epochs"], estimator["next_elevation"]["epochs"]
    n_lowest = len(known.elevations)
    epoch_s = one["train"] * known.units / (n_lowest * first + (known.units - n_lowest) * then)
    # Until a training's job estimated, too, estimates had a job of their own.
    others_s = sum(one[rule] for rule in OF_UNIT) + one.get("estimate", 0.0)
    return Costs(
        start_s=start_s,
        category_s=one["meshes"] + one["splits"],
        elevation_s=one["render"],
        lowest_s=first * epoch_s + others_s,
        next_s=then * epoch_s + others_s,
        report_s=start_s
        + whole["settings"]
        + len(size.elevations) / n_lowest * sum(whole[rule] for rule in OF_CATEGORIES)
        + whole["claims"] * size.units / known.units,
        notice_s=notice_s,
    )


def reference_size(reference: Mapping[str, Any]) -> Size:
    """Return the size of the reference run, from its configuration."""
    elevations = (len(reference["elevations_deg"][name]) for name in reference["categories"])
    return Size(tuple(elevations), reference["n_folds"])


def makespan_s(size: Size, cost: Costs, cores: int) -> float:
    """Return the seconds from the first job's start to the last one's end.

    Each core takes the next job in the queue: first the data of every category, then its folds as
    soon as its data are there, the longest first, then the report.
    """
    free_at_s = [0.0] * cores
    ready = []
    for elevations in size.elevations:
        ended_s = heapq.heappop(free_at_s) + cost.data_s(elevations)
        heapq.heappush(free_at_s, ended_s)
        ready += [(-elevations, ended_s + cost.notice_s)] * size.folds
    last_s = 0.0
    for elevations, ready_s in sorted(ready):
        ended_s = max(heapq.heappop(free_at_s), ready_s) + cost.fold_s(-elevations)
        heapq.heappush(free_at_s, ended_s)
        last_s = max(last_s, ended_s)
    return last_s + cost.notice_s + cost.report_s


def work_s(size: Size, cost: Costs) -> float:
    """Return the seconds of all cores together."""
    of_categories = (cost.data_s(n) + size.folds * cost.fold_s(n) for n in size.elevations)
    return sum(of_categories) + cost.report_s


def critical_path_s(size: Size, cost: Costs) -> float:
    """Return the seconds that no number of cores goes below."""
    longest = max(cost.data_s(n) + cost.fold_s(n) for n in size.elevations)
    return longest + cost.report_s + 2 * cost.notice_s


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
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="a finished run's folder")
    options = parser.parse_args(arguments)
    size = Size((options.elevations,) * options.categories, options.folds)
    cost = costs(
        size,
        load_measured(options.reference / "runtime.csv"),
        read_configuration(options.reference),
        options.start_s,
        options.notice_s,
    )
    print(
        f"{size.units} units, {size.jobs} jobs, {work_s(size, cost) / 3600:.1f} core-hours; "
        f"critical path {critical_path_s(size, cost) / 60:.1f} min"
    )
    for nodes in options.nodes:
        minutes = makespan_s(size, cost, nodes * options.cores) / 60
        print(f"{nodes} nodes of {options.cores} cores: {minutes:.1f} min")


if __name__ == "__main__":
    main()

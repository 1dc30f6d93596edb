"""How busy the paper run kept its cores, from what that run left behind.

Nothing is run: the figure is read from `results/paper`. A job started when its benchmark file was
written less the seconds that the file states. What its processor time was, its log says exactly.
Snakemake's own figure is that of its last sample, up to 30 s before a job's end, so that without
the logs only bounds are known.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from benchmarks.figures import Figure, Target
from benchmarks.settings import ROOT
from nbv.evaluation.runtime import load_runtime

NAME, TARGET = "workflow: processor time / (cores × wall)", Target(0.90)
# Longer times without any job are between two runs, one of which was stopped.
_PAUSE_S = 60.0
# The file is written a moment after the job has ended.
_TOLERANCE_S = 1.0
# What `nbv.jobs.job` logs last.
_PROCESSOR_TIME = re.compile(r"([\d.]+) s of processor time")


@dataclass(frozen=True)
class Job:
    """When a job ran, on how many cores, and its processor time where its log tells it."""

    start: float
    end: float
    takes_all_cores: bool
    cpu_s: float | None


def run(quick: bool) -> list[Figure]:
    return [utilisation(ROOT / "results" / "paper")]


def utilisation(results: Path) -> Figure:
    """Return the share of the cores' time that jobs computed for."""
    jobs = read_jobs(results)
    if not jobs:
        return Figure(NAME, None, TARGET, f"not run: no {results.name}/benchmarks; run make first")
    wall_s = _wall_seconds(jobs)
    cores = _most_at_once(jobs)
    occupied_s = sum((j.end - j.start) * (cores if j.takes_all_cores else 1) for j in jobs)
    if occupied_s > 1.05 * cores * wall_s:
        reason = "its files' times are not those of the run; they have been copied"
        return Figure(NAME, None, TARGET, f"cannot be told: {reason}")
    available = cores * wall_s
    detail = (
        f"{len(jobs)} jobs in {wall_s:.0f} s, at most {cores} at once; "
        f"a job was running on {occupied_s / available:.0%} of the cores' time"
    )
    exact = [job.cpu_s for job in jobs if job.cpu_s is not None]
    if len(exact) == len(jobs):
        return Figure(NAME, sum(exact) / available, TARGET, detail)
    sampled = float(load_runtime(results)["cpu_s"].sum()) / available
    if TARGET.holds(sampled):
        return Figure(NAME, sampled, TARGET, f"at least; {detail}")
    bounds = f"between {sampled:.2f} (Snakemake's samples) and {occupied_s / available:.2f}"
    return Figure(NAME, None, TARGET, f"{bounds}: {len(jobs) - len(exact)} logs do not say; {detail}")


def read_jobs(results: Path) -> list[Job]:
    """Return the jobs of `results/<experiment>/benchmarks`."""
    folder = results / "benchmarks"
    jobs = []
    for path in sorted(folder.rglob("*.tsv")):
        seconds = float(pd.read_csv(path, sep="\t", na_values=["-"])["s"].iloc[-1])
        end = path.stat().st_mtime
        name = path.relative_to(folder).with_suffix(".log")
        cpu_s = _logged_processor_time(results / "logs" / name)
        # The one rule that runs a process on every core.
        jobs.append(Job(end - seconds, end, name.parts[0] == "meshes", cpu_s))
    return jobs


def _logged_processor_time(log: Path) -> float | None:
    found = _PROCESSOR_TIME.findall(log.read_text(encoding="utf-8")) if log.exists() else []
    return float(found[-1]) if found else None


def _wall_seconds(jobs: list[Job]) -> float:
    ordered = sorted(jobs, key=lambda job: job.start)
    wall, until = 0.0, ordered[0].start
    for job in ordered:
        pause = job.start - until
        if job.end > until:
            wall += job.end - until - (pause if pause > _PAUSE_S else 0.0)
            until = job.end
    return wall


def _most_at_once(jobs: list[Job]) -> int:
    changes = []
    for job in jobs:
        if job.end - job.start > 2 * _TOLERANCE_S:
            changes += [(job.start + _TOLERANCE_S, 1), (job.end - _TOLERANCE_S, -1)]
    running = most = 0
    for _, change in sorted(changes):
        running += change
        most = max(most, running)
    return max(most, 1)

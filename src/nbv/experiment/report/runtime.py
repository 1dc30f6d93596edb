"""The running time of a run, from the benchmark and log files of its jobs."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.experiment.report.table import Cell, Row, Table
from nbv.files import readable
from nbv.labels import duration, number

RUNTIME_COLUMNS = (
    "rule",
    "jobs",
    "cpu_s",
    "wall_s",
    "median_s",
    "max_s",
    "peak_mib",
    "sampled_jobs",
    "elapsed_s",
    "side_by_side",
)
JOB_COLUMNS = ("rule", "cpu_s", "sampled", "wall_s", "peak_mib", "ended_s")
TOTAL_ROW = "all"
PAUSE_S = 60.0
"""Longer gaps between jobs are pauses and do not count."""

_PROCESSOR_TIME = re.compile(r"processor time (\d+\.\d+) s$", re.MULTILINE)
# Benchmark files round to hundredths of a second, so consecutive jobs may seem to overlap.
_ROUNDING_S = 0.01
_HEADER = (
    "Rule",
    "Jobs",
    "Processor (s)",
    "Wall clock (s)",
    "Median job (s)",
    "Longest job (s)",
    "Peak memory (MiB)",
)


def load_jobs(files: Iterable[tuple[str, Path, Path]]) -> pd.DataFrame:
    """Read the running time of jobs from their benchmark and log files.

    Snakemake samples a script's process and its children 31 times half a second apart, then every
    30 seconds, and keeps the last processor time. For a job of 45 seconds it may miss two thirds.
    A job's log may end with the operating system's figure (``processor time 12.3 s``), which misses
    only the shutdown of the interpreter. Neither can be too large, so the larger one counts.

    Parameters
    ----------
    files : iterable of (rule, benchmark file, log file)
        Jobs without a benchmark file are skipped. The modification time of the file is the end of
        the job: a copy must preserve it.

    Returns
    -------
    pandas.DataFrame
        `JOB_COLUMNS`, one row per job: processor and wall-clock seconds, whether the former is
        only Snakemake's last sample, peak resident memory in MiB (Snakemake's ``max_rss``; NaN for
        a job that ended before a sample), and the end in seconds since the epoch.
    """
    jobs = []
    for rule, benchmark, log in files:
        if not benchmark.is_file():
            continue
        logged = _logged_cpu_s(log)
        with readable(benchmark):
            table = pd.read_csv(benchmark, sep="\t", na_values=["-"])
        for row in table.reindex(columns=["s", "cpu_time", "max_rss"]).to_dict("records"):
            cpu_s = max(logged or 0.0, float(np.nan_to_num(row["cpu_time"])))
            ended_s = benchmark.stat().st_mtime
            jobs.append((rule, cpu_s, logged is None, row["s"], row["max_rss"], ended_s))
    return pd.DataFrame(jobs, columns=list(JOB_COLUMNS))


def summarise_jobs(jobs: pd.DataFrame) -> pd.DataFrame:
    """Summarise the jobs of `load_jobs` by rule.

    Returns
    -------
    pandas.DataFrame
        `RUNTIME_COLUMNS`: rules by decreasing wall-clock time, then the row `TOTAL_ROW`. ``cpu_s``
        and ``wall_s`` are sums over jobs; ``median_s`` and ``max_s`` are wall-clock times of single
        jobs; ``peak_mib`` is that of the largest job; ``sampled_jobs`` counts jobs whose processor
        time is too low (see `load_jobs`). Only the total has ``elapsed_s``, from the first start to
        the last end less pauses of more than `PAUSE_S`, and ``side_by_side``, the most jobs at
        once. Empty where nothing was benchmarked.
    """
    if jobs.empty:
        return pd.DataFrame(columns=list(RUNTIME_COLUMNS))
    rules = [_summary(str(rule), part) for rule, part in jobs.groupby("rule", sort=True)]
    rules.sort(key=lambda row: row["wall_s"], reverse=True)
    total = _summary(TOTAL_ROW, jobs)
    total["elapsed_s"], total["side_by_side"] = _on_the_clock(jobs)
    summary = pd.DataFrame([*rules, total], columns=list(RUNTIME_COLUMNS))
    return summary.astype({"side_by_side": "Int64"})


def runtime_table(jobs: pd.DataFrame) -> Table:
    """Return the table of the jobs of `load_jobs` by rule."""
    runtime = summarise_jobs(jobs)
    rows = tuple(_row(row) for row in runtime.to_dict("records"))
    notes = ("No job was timed in this run.",) if runtime.empty else tuple(_notes(runtime))
    title = "Running time"
    return Table("runtime", title, title, runtime, _HEADER, rows, notes)


def efficiency(runtime: pd.DataFrame) -> float:
    """Return Σ cpu / (side_by_side × elapsed): the utilisation of the processors, in [0, 1]."""
    total = runtime.iloc[-1]
    return float(total["cpu_s"] / (total["side_by_side"] * total["elapsed_s"]))


def _logged_cpu_s(log_file: Path) -> float | None:
    """Return the processor time at the end of a job's log, if it is there."""
    if not log_file.is_file():
        return None
    logged = _PROCESSOR_TIME.findall(log_file.read_text(encoding="utf-8", errors="replace"))
    return float(logged[-1]) if logged else None


def _row(summary: Mapping[Hashable, Any]) -> Row:
    seconds = [f"{summary[name]:,.1f}" for name in ("cpu_s", "wall_s", "median_s", "max_s")]
    memory = f"{summary['peak_mib']:,.0f}" if np.isfinite(summary["peak_mib"]) else "–"
    texts = (summary["rule"], f"{summary['jobs']:,}", *seconds, memory)
    return tuple(Cell(text) for text in texts)


def _summary(rule: str, jobs: pd.DataFrame) -> dict[str, Any]:
    return {
        "rule": rule,
        "jobs": len(jobs),
        "cpu_s": jobs["cpu_s"].sum(),
        "wall_s": jobs["wall_s"].sum(),
        "median_s": jobs["wall_s"].median(),
        "max_s": jobs["wall_s"].max(),
        "peak_mib": jobs["peak_mib"].max(),
        "sampled_jobs": int(jobs["sampled"].sum()),
    }


def _on_the_clock(jobs: pd.DataFrame) -> tuple[float, int]:
    """Return the duration of a run in seconds without pauses, and the most jobs at once."""
    ends = jobs["ended_s"].to_numpy(dtype=np.float64)
    starts = ends - jobs["wall_s"].to_numpy(dtype=np.float64)
    order = np.argsort(starts, kind="stable")
    last_end = np.maximum.accumulate(ends[order])
    gaps = starts[order][1:] - last_end[:-1]
    elapsed_s = float(last_end[-1] - starts.min() - gaps[gaps > PAUSE_S].sum())
    begun = np.minimum(starts + _ROUNDING_S, ends)
    return elapsed_s, int(max(((begun <= t) & (t < ends)).sum() for t in begun))


def _notes(runtime: pd.DataFrame) -> list[str]:
    total = runtime.iloc[-1]
    jobs, sampled = int(total["jobs"]), int(total["sampled_jobs"])
    at_once, busy = int(total["side_by_side"]), number(100 * efficiency(runtime), 0)
    at_least = "at least " if sampled else ""
    notes = [
        f"From the first job's start to the last one's end: {duration(total['elapsed_s'])}, "
        f"leaving out pauses of more than {PAUSE_S:.0f} s in which no job ran. At most {at_once} "
        f"{'job' if at_once == 1 else 'jobs'} ran at once; the jobs' own work kept as many "
        f"processors busy for {at_least}{busy} % of that time. Other work on the machine lowers "
        "that figure and lengthens every time here but the processors'.",
        "Processor and wall-clock times are sums over jobs, some of which ran side by side. A job "
        "that was run again counts once, as it last ran; the jobs that write this table and the "
        "report do not count, nor does Snakemake's own start.",
    ]
    if sampled:
        which = "Processor times" if sampled == jobs else f"Processor times of {sampled} jobs"
        notes.append(
            f"{which} are Snakemake's samples, half a second apart for the first 15 s of a job and "
            "30 s apart after that, and lack what a job did after its last one."
        )
    notes.append(
        "Memory is the largest that Snakemake sampled of any one job, worker processes included; "
        "a short peak may have escaped it."
    )
    return notes

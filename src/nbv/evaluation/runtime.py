"""What a run cost, from Snakemake's benchmark files."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

RUNTIME_COLUMNS = ("rule", "jobs", "cpu_s", "wall_s", "max_rss_mb")


def load_runtime(root: str | Path) -> pd.DataFrame:
    """Sum up ``benchmarks/<rule>/**/*.tsv`` by rule.

    Parameters
    ----------
    root : path
        ``results/<experiment>``.

    Returns
    -------
    pandas.DataFrame
        `RUNTIME_COLUMNS`, the longest rule first: number of jobs, processor and wall-clock
        seconds summed over them, and the largest resident memory of any one in MB (Snakemake's
        ``max_rss``). Jobs too short to be sampled have no memory, and count as no processor time.
        Empty where nothing was benchmarked.
    """
    directory = Path(root) / "benchmarks"
    jobs = []
    for path in sorted(directory.rglob("*.tsv")):
        rule = path.relative_to(directory).parts[0].removesuffix(".tsv")
        table = pd.read_csv(path, sep="\t", na_values=["-"])
        for name in ("s", "cpu_time", "max_rss"):
            if name not in table.columns:
                table[name] = float("nan")
        jobs.append(table[["s", "cpu_time", "max_rss"]].assign(rule=rule))
    if not jobs:
        return pd.DataFrame(columns=list(RUNTIME_COLUMNS))
    by_rule = pd.concat(jobs, ignore_index=True).groupby("rule", sort=True)
    summary = pd.DataFrame(
        {
            "jobs": by_rule.size(),
            "cpu_s": by_rule["cpu_time"].sum(),
            "wall_s": by_rule["s"].sum(),
            "max_rss_mb": by_rule["max_rss"].max(),
        }
    ).reset_index()
    ordered = summary.sort_values("wall_s", ascending=False, kind="stable", ignore_index=True)
    return ordered[list(RUNTIME_COLUMNS)]

"""Sum up the running time of the jobs."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.report.runtime import load_jobs, runtime_table
    from nbv.experiment.report.table import write_table

    given = snakemake.input
    files = zip(
        snakemake.params.rules, map(Path, given.benchmarks), map(Path, given.logs), strict=True
    )
    write_table(runtime_table(load_jobs(list(files))), dict(snakemake.output.items()))

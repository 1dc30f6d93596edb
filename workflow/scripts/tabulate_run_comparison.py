"""Compare the errors of the same methods in several runs."""

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_evaluations
    from nbv.layout import files_by_run
    from nbv.reporting.extensions.runs import run_comparison
    from nbv.reporting.settings import ReportSettings
    from nbv.reporting.table import write_table

    params = snakemake.params
    files = files_by_run(params.evaluations, snakemake.input.evaluations)
    runs = {run: load_evaluations(found) for run, found in files.items()}
    table = run_comparison(runs, ReportSettings(**params.settings))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

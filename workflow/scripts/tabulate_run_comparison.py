"""Compare the errors of the same methods in several runs."""

from nbv.experiment.jobs import job

with job(snakemake):
    from studies.runs import run_comparison

    from nbv.experiment.layout import files_by_run
    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table
    from nbv.experiment.results import load_evaluations

    params = snakemake.params
    files = files_by_run(params.evaluations, snakemake.input.evaluations)
    runs = {run: load_evaluations(found) for run, found in files.items()}
    table = run_comparison(runs, ReportSettings(**params.settings))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

"""Tabulate the errors of several runs side by side."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.runs import files_by_run, load_estimate_errors, runs_table

    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table
    from nbv.experiment.results import load_evaluations

    given, params = snakemake.input, snakemake.params
    estimates = files_by_run(params.estimates, given.estimates)
    evaluations = files_by_run(params.evaluations, given.evaluations)
    table = runs_table(
        {run: load_estimate_errors(files) for run, files in estimates.items()},
        {run: load_evaluations(files) for run, files in evaluations.items()},
        ReportSettings(**params.settings),
    )
    write_table(table, dict(snakemake.output.items()), params.caution)

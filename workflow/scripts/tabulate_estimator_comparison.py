"""Compare the errors of one view in several runs."""

from nbv.experiment.jobs import job

with job(snakemake):
    from studies.runs import estimator_comparison

    from nbv.experiment.layout import files_by_run
    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table
    from nbv.experiment.results import load_estimate_errors

    params = snakemake.params
    files = files_by_run(params.estimates, snakemake.input.estimates)
    runs = {run: load_estimate_errors(found) for run, found in files.items()}
    table = estimator_comparison(runs, ReportSettings(**params.settings))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

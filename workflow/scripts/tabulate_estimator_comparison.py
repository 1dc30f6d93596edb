"""Compare the errors of one view in several runs."""

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_estimate_errors
    from nbv.layout import files_by_run
    from nbv.reporting.extensions.runs import estimator_comparison
    from nbv.reporting.settings import ReportSettings
    from nbv.reporting.table import write_table

    params = snakemake.params
    files = files_by_run(params.estimates, snakemake.input.estimates)
    runs = {run: load_estimate_errors(found) for run, found in files.items()}
    table = estimator_comparison(runs, ReportSettings(**params.settings))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

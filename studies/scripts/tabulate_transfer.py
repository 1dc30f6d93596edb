"""Tabulate the errors of estimators trained under one condition and tested under another."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.transfer import load_transfer, transfer_table

    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table

    params = snakemake.params
    files = dict(zip(params.evaluations, snakemake.input.evaluations, strict=True))
    evaluations = load_transfer(files, params.unit)
    settings = ReportSettings(**params.settings)
    table = transfer_table(evaluations, params.conditions, params.unit, settings)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

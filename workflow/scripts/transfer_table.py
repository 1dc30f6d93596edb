"""Build the table of estimators trained under one condition and tested under another."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.reporting.extensions.transfer import build_transfer, load_transfer
    from nbv.reporting.paper.layout import save_table
    from nbv.reporting.settings import ReportSettings as ReadingSettings

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    settings = ReadingSettings(**params.reading)
    evaluations = load_transfer(
        results, list(params.conditions), params.unit, params.folds, settings.methods
    )
    table = build_transfer(evaluations, params.conditions, params.unit, settings)
    save_table(table, Path(snakemake.output[0]).with_suffix(""))

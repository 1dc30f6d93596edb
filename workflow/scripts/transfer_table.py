"""Build the table of estimators trained under one condition and tested under another."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.evaluation.layout import save_table
    from nbv.evaluation.settings import ReadingSettings
    from nbv.evaluation.transfer import build_transfer, load_transfer

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    settings = ReadingSettings(**params.reading)
    evaluations = load_transfer(
        results, list(params.conditions), params.unit, params.folds, settings.methods
    )
    table = build_transfer(evaluations, params.conditions, params.unit, settings)
    save_table(table, Path(snakemake.output[0]).with_suffix(""))

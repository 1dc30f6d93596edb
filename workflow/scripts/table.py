"""Build one of the paper's tables."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.evaluation.layout import save_table
    from nbv.evaluation.results import load_evaluations
    from nbv.evaluation.settings import ReadingSettings
    from nbv.evaluation.tables import build_table

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    evaluations = load_evaluations(results, params.units, params.n_folds, params.reading["methods"])
    settings = ReadingSettings(**params.reading)
    table = build_table(snakemake.wildcards.table, evaluations, settings)
    save_table(table, Path(snakemake.output[0]).with_suffix(""))

"""Build one of the paper's tables."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_evaluations
    from nbv.reporting.paper.layout import save_table
    from nbv.reporting.paper.tables import build_table
    from nbv.reporting.settings import ReportSettings as ReadingSettings

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    evaluations = load_evaluations(results, params.units, params.n_folds, params.reading["methods"])
    settings = ReadingSettings(**params.reading)
    table = build_table(snakemake.wildcards.table, evaluations, settings)
    save_table(table, Path(snakemake.output[0]).with_suffix(""))

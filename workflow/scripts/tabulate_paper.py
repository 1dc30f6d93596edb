"""Build one of the paper's tables."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_evaluations
    from nbv.reporting.paper.tables import build_table
    from nbv.reporting.settings import ReportSettings
    from nbv.reporting.table import write_table

    given, params = snakemake.input, snakemake.params
    files = zip(params.evaluations, map(Path, given.evaluations), strict=True)
    settings = ReportSettings(**params.settings)
    table = build_table(snakemake.wildcards.table, load_evaluations(dict(files)), settings)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

"""Build one of the paper's tables."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table
    from nbv.experiment.report.tables import build_table
    from nbv.experiment.results import load_evaluations

    given, params = snakemake.input, snakemake.params
    files = zip(params.evaluations, map(Path, given.evaluations), strict=True)
    settings = ReportSettings(**params.settings)
    table = build_table(snakemake.wildcards.table, load_evaluations(dict(files)), settings)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

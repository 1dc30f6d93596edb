"""Hold the methods' errors in this run against those in the runs beside it."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.files import write_csv, write_text
    from nbv.reporting.extensions.runs import sidebyside_cells, sidebyside_markdown
    from nbv.reporting.settings import ReportSettings as ReadingSettings

    params, results = snakemake.params, Path(snakemake.output.csv).parents[2]
    runs = {name: (results / name, methods) for name, methods in params.runs.items()}
    settings = ReadingSettings(**params.reading)
    cells = sidebyside_cells(runs, params.units, params.n_folds, settings)
    write_csv(snakemake.output.csv, cells)
    write_text(snakemake.output.md, sidebyside_markdown(cells))

"""Say how well each density of this run, and of those beside it, knows the azimuth."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.files import write_csv, write_text
    from nbv.reporting.extensions.densities import (
        likelihood_cells,
        likelihoods_markdown,
        temperature_notes,
    )
    from nbv.reporting.settings import ReportSettings as ReadingSettings

    params, results = snakemake.params, Path(snakemake.output.csv).parents[2]
    runs = {name: (results / name, classes) for name, classes in params.runs.items()}
    settings = ReadingSettings(**params.reading)
    cells = likelihood_cells(runs, params.units, params.n_folds, settings)
    write_csv(snakemake.output.csv, cells)
    notes = temperature_notes(runs, params.units, params.n_folds)
    write_text(snakemake.output.md, likelihoods_markdown(cells, notes))

"""Tabulate and draw error and travel against the number of views."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np
    from studies.curve_tables import more_views_figure, more_views_table, read_rows

    from nbv.experiment.report.table import write_table
    from nbv.experiment.statistics.paired import Resampler
    from nbv.style import save_figure

    params, output = snakemake.params, snakemake.output
    files = dict(zip(params.folds, snakemake.input.rows, strict=True))
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = more_views_table(read_rows(files), resampler)
    paths = {kind: output[kind] for kind in ("csv", "md", "tex")}
    write_table(table, paths, params.caution)
    paths = {kind: output[kind] for kind in ("png", "pdf", "svg")}
    save_figure(more_views_figure(table.cells), paths)

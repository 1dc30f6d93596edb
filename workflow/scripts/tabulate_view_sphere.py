"""Tabulate what it brings to choose the elevation with the rotation."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    from studies.blocks import rows_by_category

    from nbv.experiment.report.extensions.view_sphere import view_sphere_table
    from nbv.experiment.report.table import write_table
    from nbv.experiment.statistics.paired import Resampler

    params = snakemake.params
    files = zip(params.folds, snakemake.input.rows, strict=True)
    rows = rows_by_category({(params.category, fold): path for fold, path in files})
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = view_sphere_table(rows[params.category], params.category, resampler)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

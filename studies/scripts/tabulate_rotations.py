"""Tabulate two views in three dimensions, pooled over objects."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    from studies.rotation_tables import rotation_table
    from studies.rotations import read_symmetries

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv

    given, params = snakemake.input, snakemake.params
    symmetries = read_symmetries(given.models_info)
    turning = [name for name, symmetry in symmetries.items() if symmetry.axis is not None]
    rng = np.random.default_rng(params.seed)
    table = rotation_table(read_csv(given.figures), turning, params.n_resamples, rng)
    write_table(table, dict(snakemake.output.items()))

"""Tabulate two views in three dimensions, pooled over objects."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd
    from studies.rotation_tables import by_symmetry, orientation_table

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv
    from nbv.tables.bop import read_models_info

    given, params = snakemake.input, snakemake.params
    figures = [read_csv(path) for path in given.figures]
    if len(figures) > 1:
        figures = [each.assign(training=k) for k, each in enumerate(figures)]
    figures = pd.concat(figures, ignore_index=True)
    names = list(figures["object_id"].unique())
    groups = {name: [name] for name in names}
    if given.models_info:
        groups = by_symmetry(names, read_models_info(given.models_info))
    if len(names) > 1 and "training" in figures:
        groups["all categories"] = names
    rng = np.random.default_rng(params.seed)
    table = orientation_table(figures, groups, params.n_resamples, rng)
    write_table(table, dict(snakemake.output.items()))

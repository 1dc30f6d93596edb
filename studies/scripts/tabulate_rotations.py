"""Tabulate two views in three dimensions, pooled over objects."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd
    from studies.rotation_tables import by_symmetry, rotation_table
    from studies.rotations import read_symmetries

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv

    given, params = snakemake.input, snakemake.params
    symmetries = read_symmetries(given.models_info) if given.models_info else {}
    found = [read_csv(path) for path in given.figures]
    if len(found) > 1:
        found = [figures.assign(training=k) for k, figures in enumerate(found)]
    figures = pd.concat(found, ignore_index=True)
    names = list(figures["object_id"].unique())
    groups = by_symmetry(names, symmetries) if symmetries else {name: [name] for name in names}
    if len(names) > 1 and "training" in figures:
        groups["all categories"] = names
    rng = np.random.default_rng(params.seed)
    table = rotation_table(figures, groups, params.n_resamples, rng)
    write_table(table, dict(snakemake.output.items()))

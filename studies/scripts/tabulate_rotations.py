"""Tabulate two views in three dimensions, pooled over objects, and draw one object."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd
    from studies.rotation_figure import example, rotation_figure
    from studies.rotation_tables import by_symmetry, orientation_table
    from studies.rotations import read_symmetries

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv
    from nbv.robot.style import save_figure

    given, params, output = snakemake.input, snakemake.params, snakemake.output
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
    table = orientation_table(figures, groups, params.n_resamples, rng)
    write_table(table, {kind: output[kind] for kind in ("csv", "md")})
    figure = rotation_figure(example(given.pairs, symmetries, params.settings))
    save_figure(figure, {kind: output[kind] for kind in ("png", "pdf", "svg")})

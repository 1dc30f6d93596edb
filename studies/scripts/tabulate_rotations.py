"""Tabulate two views in three dimensions, pooled over objects, and draw one object."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    from studies.rotation_figure import example, rotation_figure
    from studies.rotation_tables import rotation_table
    from studies.rotations import read_symmetries

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv
    from nbv.robot.style import save_figure

    given, params, output = snakemake.input, snakemake.params, snakemake.output
    symmetries = read_symmetries(given.models_info)
    turning = [name for name, symmetry in symmetries.items() if symmetry.axis is not None]
    rng = np.random.default_rng(params.seed)
    table = rotation_table(read_csv(given.figures), turning, params.n_resamples, rng)
    write_table(table, {kind: output[kind] for kind in ("csv", "md")})
    figure = rotation_figure(example(given.pairs, symmetries, params.settings))
    save_figure(figure, {kind: output[kind] for kind in ("png", "pdf", "svg")})

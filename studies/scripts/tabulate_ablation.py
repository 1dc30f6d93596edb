"""Tabulate the effect of each choice in the paper's method."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np
    from studies.ablation import ablation_space, ablation_table

    from nbv.experiment.report.table import write_table
    from nbv.experiment.statistics.paired import Resampler
    from nbv.files import read_csv

    params = snakemake.params
    rows = {row: read_csv(path) for row, path in enumerate(snakemake.input.rows)}
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = ablation_table(ablation_space(), rows, params.category, resampler)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

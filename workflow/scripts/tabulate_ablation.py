"""Tabulate what each choice in the paper's method brings."""

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.experiments.ablation import ablation_space
    from nbv.files import read_csv
    from nbv.reporting.extensions.ablation import ablation_table
    from nbv.reporting.table import write_table
    from nbv.statistics.paired import Resampler

    params = snakemake.params
    rows = {row: read_csv(path) for row, path in enumerate(snakemake.input.rows)}
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = ablation_table(ablation_space(), rows, params.category, resampler)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

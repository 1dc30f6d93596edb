"""Set the ablation's settings side by side."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.experiments.ablation import ablation_space
    from nbv.files import read_csv
    from nbv.reporting.extensions.ablation import ablation_sheet
    from nbv.reporting.sheets import save_sheet
    from nbv.statistics.paired import Resampler

    params = snakemake.params
    found = {row: read_csv(path) for row, path in enumerate(snakemake.input.found)}
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    sheet = ablation_sheet(ablation_space(), found, params.category, resampler)
    save_sheet(sheet, Path(snakemake.output[0]).with_suffix(""))

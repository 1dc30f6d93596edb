"""What choosing the elevation with the rotation gains, as a table."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd

    from nbv.files import read_csv
    from nbv.reporting.sheets import save_sheet, sphere_sheet
    from nbv.statistics.paired import Resampler

    params = snakemake.params
    rows = pd.concat([read_csv(path).assign(fold=fold) for fold, path in params.files.items()])
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    sheet = sphere_sheet(rows, params.category, resampler)
    save_sheet(sheet, Path(snakemake.output[0]).with_suffix(""))

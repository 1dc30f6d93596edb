"""Error and travel against the number of views, as a table and a figure."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np
    import pandas as pd

    from nbv.files import read_csv
    from nbv.reporting.extensions.curves import sequences
    from nbv.reporting.paper.figures import save_figure
    from nbv.reporting.sheets import save_sheet, sequence_sheet
    from nbv.statistics.paired import Resampler

    params = snakemake.params
    rows = {
        category: pd.concat([read_csv(path).assign(fold=fold) for fold, path in paths.items()])
        for category, paths in params.files.items()
    }
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    sheet = sequence_sheet(rows, resampler)
    save_sheet(sheet, Path(snakemake.output.table[0]).with_suffix(""))
    save_figure(sequences(sheet.cells), Path(snakemake.output.figure[0]).with_suffix(""))

"""Error against travel, as a table and a figure."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import pandas as pd

    from nbv.experiments.travel import pooled_travel
    from nbv.files import read_csv, write_csv
    from nbv.reporting.extensions.curves import travel
    from nbv.reporting.paper.figures import save_figure

    params = snakemake.params
    curves = {
        category: pooled_travel({fold: read_csv(path) for fold, path in paths.items()})
        for category, paths in params.files.items()
    }
    named = [curve.assign(category=category) for category, curve in curves.items()]
    write_csv(snakemake.output.table, pd.concat(named), decimals=6)
    figure = travel(curves, tuple(params.methods))
    save_figure(figure, Path(snakemake.output.figure[0]).with_suffix(""))

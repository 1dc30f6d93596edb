"""Tabulate the single views of the study's own estimators in three dimensions."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.rotation_tables import estimator_table

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv

    pairs = pd.concat([read_csv(path) for path in snakemake.input.pairs], ignore_index=True)
    table = estimator_table(pairs, snakemake.params.poses)
    write_table(table, dict(snakemake.output.items()))

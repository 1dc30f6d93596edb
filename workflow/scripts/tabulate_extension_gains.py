"""Tabulate what the extensions gain over the paper's method and over Opposite."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np
    from studies.blocks import blocks_of
    from studies.gains import extension_gains_table

    from nbv.experiment.layout import files_by_run
    from nbv.experiment.report.table import write_table
    from nbv.experiment.statistics.object_means import load_folds
    from nbv.experiment.statistics.paired import Resampler

    given, params = snakemake.input, snakemake.params
    objects = files_by_run(params.folds, given.objects)
    choices = files_by_run(params.folds, given.choices)
    blocks = blocks_of({run: load_folds(found) for run, found in objects.items()})
    choices = {run: load_folds(found) for run, found in choices.items()}
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = extension_gains_table(blocks, choices, params.methods, resampler)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

"""Rank all methods on one run or on several."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np
    from studies.leaderboard import blocks_of, leaderboard_table
    from studies.object_errors import load_folds
    from studies.runs import files_by_run

    from nbv.experiment.report.table import write_table
    from nbv.experiment.statistics.paired import Resampler

    params = snakemake.params
    files = files_by_run(params.folds, snakemake.input.objects)
    blocks = blocks_of({run: load_folds(paths) for run, paths in files.items()})
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    table = leaderboard_table(blocks, params.methods, resampler)
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

"""Rank all methods on one run or on several, and say what going beyond the paper gains."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.evaluation.leaderboard import beyond, blocks_of, leaderboard
    from nbv.evaluation.paired import Resampler
    from nbv.evaluation.sheets import save_sheet
    from nbv.evaluation.standing import load_object_means

    params = snakemake.params
    runs = {run: load_object_means(paths) for run, paths in params.objects.items()}
    blocks = blocks_of(runs)
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    for path, build in zip(snakemake.output[::3], (leaderboard, beyond), strict=True):
        save_sheet(build(blocks, resampler), Path(path).with_suffix(""))

"""Rank all methods on one run or on several, and say what going beyond the paper gains."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.reporting.extensions.leaderboard import beyond, blocks_of, favoured, leaderboard
    from nbv.reporting.sheets import save_sheet
    from nbv.statistics.object_means import load_choices, load_object_means
    from nbv.statistics.paired import Resampler

    params = snakemake.params
    runs = {run: load_object_means(paths) for run, paths in params.objects.items()}
    blocks = blocks_of(runs)
    resampler = Resampler.seeded(np.random.default_rng(params.seed), params.n_resamples)
    choices = {run: load_choices(paths) for run, paths in params.objects.items()}
    pairs = {
        run: (best, f"opposite_{params.contenders[best]['fusion']}")
        for run, best in favoured(choices).items()
    }
    sheets = leaderboard(blocks, resampler), beyond(blocks, pairs, resampler)
    for path, sheet in zip(snakemake.output[::3], sheets, strict=True):
        save_sheet(sheet, Path(path).with_suffix(""))

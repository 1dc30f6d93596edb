"""Divide one category's objects into folds."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.core.seeds import rng_for
    from nbv.data.meshes import load_meshes
    from nbv.experiment.splits import make_splits
    from nbv.files import write_csv

    params = snakemake.params
    splits = make_splits(
        params.get("objects") or list(load_meshes(snakemake.input.meshes)),
        params.n_folds,
        params.calibration_fraction,
        rng_for(params.seed, "splits", *snakemake.wildcards),
        params.get("crossfit_parts"),
    )
    write_csv(snakemake.output[0], splits)

"""Join the kept estimates of all trainings in one file."""

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.kept_estimates import join_kept

    join_kept(snakemake.output[0], snakemake.input.kept)

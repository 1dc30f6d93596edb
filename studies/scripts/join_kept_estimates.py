"""Join the kept estimates of all trainings in one file."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.kept_estimates import join_kept

    join_kept(snakemake.output[0], snakemake.input.kept)

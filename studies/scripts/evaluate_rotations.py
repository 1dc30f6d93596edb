"""Evaluate every pair of views of every instance, with calibration on other instances."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.rotations import evaluate

    from nbv.files import write_csv

    given = snakemake.input
    figures = evaluate(given.pairs, given.models_info or None, snakemake.params.settings)
    write_csv(snakemake.output[0], figures)

"""Evaluate every pair of views of every instance, with calibration on other instances."""

from nbv.experiment.jobs import job

with job(snakemake):
    from studies.rotations import evaluate, read_symmetries

    from nbv.files import write_csv

    given = snakemake.input
    symmetries = read_symmetries(given.models_info) if given.models_info else {}
    figures = evaluate(given.pairs, symmetries, snakemake.params.settings)
    write_csv(snakemake.output[0], figures)

"""Walk from every first view of every instance, with calibration on other instances."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.rotations import evaluate

    from nbv.files import write_csv

    given, params = snakemake.input, snakemake.params
    walks = evaluate(given.pairs, given.models_info or None, params.settings, params.seed)
    write_csv(snakemake.output[0], walks, decimals=6)

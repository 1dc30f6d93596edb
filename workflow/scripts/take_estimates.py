"""Take the estimates of one fold's calibration and test objects from a file of another program."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.estimates import write_fold
    from nbv.experiment.external import take_fold
    from nbv.experiment.splits import read_splits
    from nbv.tables.pairs import PairTable

    given, output, wildcards = snakemake.input, snakemake.output, snakemake.wildcards
    pairs = PairTable.load(given.pairs)
    pairs = pairs.for_unit(wildcards.category, float(wildcards.elevation))
    estimates = take_fold(
        pairs.estimates,
        pairs.distributions if output.get("test_posteriors") else {},
        read_splits(given.splits),
        int(wildcards.fold),
    )
    write_fold(output, estimates)

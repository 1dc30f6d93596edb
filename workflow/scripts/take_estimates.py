"""Take the estimates of one fold's calibration and test objects from a file of another program."""

from nbv.experiment.jobs import job

with job(snakemake):
    from nbv.experiment.external import take_fold
    from nbv.experiment.held_out import write_fold
    from nbv.experiment.splits import read_splits
    from nbv.robot.pair_distributions import read_pair_distributions
    from nbv.robot.pairs import read_pairs

    given, output, wildcards = snakemake.input, snakemake.output, snakemake.wildcards
    of_unit = given.pairs, wildcards.category, float(wildcards.elevation)
    found = take_fold(
        read_pairs(*of_unit),
        read_pair_distributions(*of_unit) if output.get("test_posteriors") else {},
        read_splits(given.splits),
        int(wildcards.fold),
    )
    write_fold(output, found)

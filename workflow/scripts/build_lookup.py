"""Build the lookup table of one criterion from the calibration pairs of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.core.circle.selection import chosen_lookup
    from nbv.experiment.estimates import read_estimates
    from nbv.experiment.splits import check_role, read_splits
    from nbv.tables.lookup import LookupTable

    calibration = read_estimates(snakemake.input.calibration)
    splits = read_splits(snakemake.input.splits)
    check_role(splits, int(snakemake.wildcards.fold), "calibration", calibration.object_ids)
    table = chosen_lookup(
        calibration.estimate_deg, snakemake.wildcards.criterion, snakemake.params.density
    )
    LookupTable.of(table).save(snakemake.output[0])

"""Take the estimates of one fold's calibration and test objects from a file of another program."""

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.calibration.estimates import Estimates, write_estimates
    from nbv.calibration.pairs import read_pairs
    from nbv.calibration.splits import need_objects, objects_with_role, read_splits

    given, wildcards = snakemake.input, snakemake.wildcards
    found = read_pairs(given.pairs, wildcards.category, float(wildcards.elevation))
    splits = read_splits(given.splits)
    need_objects(splits, found.object_ids)
    for role in ("calibration", "test"):
        names = objects_with_role(splits, int(wildcards.fold), role)
        rows = found.estimate_deg[[found.object_ids.index(name) for name in names]]
        write_estimates(snakemake.output[role], Estimates(tuple(names), np.asarray(rows)))

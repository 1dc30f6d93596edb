"""Evaluate the methods that need no lookup table on the test objects of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.core.seeds import rng_for
    from nbv.experiment.estimates import read_estimates
    from nbv.experiment.results import evaluate_method
    from nbv.experiment.splits import check_role, read_splits
    from nbv.files import write_csv

    params, wildcards = snakemake.params, snakemake.wildcards
    test = read_estimates(snakemake.input.test)
    splits = read_splits(snakemake.input.splits)
    check_role(splits, int(wildcards.fold), "test", test.object_ids)
    for (name, method), path in zip(params.methods.items(), snakemake.output, strict=True):
        rng = rng_for(params.seed, name, *wildcards)
        write_csv(path, evaluate_method(method, test, rng))

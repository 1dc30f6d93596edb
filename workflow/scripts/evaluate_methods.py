"""Evaluate each method on the test objects of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.core.seeds import rng_for
    from nbv.experiment.estimates import read_estimates
    from nbv.experiment.results import evaluate_method
    from nbv.experiment.splits import check_role, read_splits
    from nbv.files import write_csv
    from nbv.tables.lookup import LookupTable

    given, params, wildcards = snakemake.input, snakemake.params, snakemake.wildcards
    test = read_estimates(given.test)
    check_role(read_splits(given.splits), int(wildcards.fold), "test", test.object_ids)
    lookups = dict(zip(params.criteria, map(LookupTable.load, given.lookups), strict=True))
    for (name, method), path in zip(params.methods.items(), snakemake.output, strict=True):
        rng = rng_for(params.seed, name, *wildcards)
        lookup = lookups.get(method["policy"])
        write_csv(path, evaluate_method(method, test, rng, lookup=lookup))

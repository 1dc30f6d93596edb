"""Evaluate one method that follows a lookup table on the test objects of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.estimates import read_estimates
    from nbv.experiment.results import evaluate_method
    from nbv.experiment.splits import check_role, read_splits
    from nbv.files import write_csv
    from nbv.tables.lookup import LookupTable

    test = read_estimates(snakemake.input.test)
    splits = read_splits(snakemake.input.splits)
    check_role(splits, int(snakemake.wildcards.fold), "test", test.object_ids)
    lookup = LookupTable.load(snakemake.input.lookup)
    write_csv(snakemake.output[0], evaluate_method(snakemake.params.method, test, lookup=lookup))

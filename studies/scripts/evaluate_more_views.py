"""Take more than two views of the test objects of one fold, by every policy."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.curves import more_views_rows
    from studies.extensions import stored_evidence

    from nbv.core.circle.evidence import evidence_of_distributions
    from nbv.core.seeds import rng_for
    from nbv.experiment.estimates import read_estimates, read_posteriors
    from nbv.experiment.splits import check_role, read_splits
    from nbv.files import read_csv, write_csv

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    splits, products = read_splits(given.splits), {}
    calibration, test = (read_estimates(given[role]) for role in ("calibration", "test"))
    check_role(splits, int(wildcards.fold), "calibration", calibration.object_ids)
    check_role(splits, int(wildcards.fold), "test", test.object_ids)
    choices = read_csv(given.choices)
    evidences = stored_evidence(calibration, choices, params.density)
    # The label seeds the draws of random views, so it keeps its old name.
    rng = rng_for(params.seed, "sequence", *wildcards)
    if path := given.get("calibration_posteriors"):
        held_out = read_posteriors(path, calibration.object_ids)
        products["of_distributions"] = evidence_of_distributions(
            held_out.distributions, params.density
        )
        products["posteriors"] = read_posteriors(given.test_posteriors, test.object_ids)
    rows = more_views_rows(test, evidences, params.more_views, rng, **products)
    write_csv(snakemake.output[0], rows)

"""Take more than two views of the test objects of one fold, by every policy."""

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.estimates import read_estimates
    from nbv.calibration.splits import need_role, read_splits
    from nbv.experiments.extensions import stored_evidence
    from nbv.experiments.more_views import more_views_rows
    from nbv.files import read_csv, write_csv
    from nbv.seeds import rng_for

    params, wildcards = snakemake.params, snakemake.wildcards
    splits = read_splits(snakemake.input.splits)
    calibration, test = (read_estimates(snakemake.input[r]) for r in ("calibration", "test"))
    need_role(splits, int(wildcards.fold), "calibration", calibration.object_ids)
    need_role(splits, int(wildcards.fold), "test", test.object_ids)
    choices = read_csv(snakemake.input.choices)
    evidences = stored_evidence(calibration, choices, params.density)
    # The label decides the draws of random views: it stays as it was.
    rng = rng_for(params.seed, "sequence", *wildcards)
    rows = more_views_rows(test, evidences, params.more_views, rng)
    write_csv(snakemake.output[0], rows)

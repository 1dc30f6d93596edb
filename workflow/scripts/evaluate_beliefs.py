"""Evaluate second views by each image's own distribution on the test objects of one fold."""

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.estimates import read_estimates
    from nbv.calibration.posteriors import read_posteriors
    from nbv.calibration.splits import assert_role, read_splits
    from nbv.experiments.image_distributions import evaluate_beliefs
    from nbv.files import write_csv

    given, fold = snakemake.input, int(snakemake.wildcards.fold)
    calibration, test = read_estimates(given.calibration), read_estimates(given.test)
    splits = read_splits(given.splits)
    assert_role(splits, fold, "calibration", calibration.object_ids)
    assert_role(splits, fold, "test", test.object_ids)
    frames = evaluate_beliefs(
        test,
        read_posteriors(given.test_posteriors, test.object_ids),
        read_posteriors(given.calibration_posteriors, calibration.object_ids),
    )
    for name, frame in frames.items():
        write_csv(snakemake.output[name], frame)

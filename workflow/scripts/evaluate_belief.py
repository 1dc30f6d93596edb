"""Evaluate recommendations from each image's own distribution on the test objects of one fold."""

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.folds import assert_role, read_splits
    from nbv.calibration.pairs import read_estimates
    from nbv.calibration.posteriors import read_posteriors
    from nbv.evaluation.belief import evaluate_belief
    from nbv.files import write_csv
    from nbv.recommendation.lookup import load_lookup

    given, fold = snakemake.input, int(snakemake.wildcards.fold)
    calibration, test = read_estimates(given.calibration), read_estimates(given.test)
    splits = read_splits(given.splits)
    assert_role(splits, fold, "calibration", calibration.object_ids)
    assert_role(splits, fold, "test", test.object_ids)
    posteriors = read_posteriors(given.posteriors, test.object_ids)
    frame = evaluate_belief(test, posteriors, calibration, load_lookup(given.lookup))
    write_csv(snakemake.output[0], frame)

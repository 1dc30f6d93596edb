"""Fit the linear estimator of each fold to depth features, and estimate held-out objects."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.estimates import write_fold
    from nbv.experiment.estimation.linear import fit_fold
    from nbv.experiment.estimation.outputs import estimates_of
    from nbv.experiment.splits import objects_with_role, read_splits, training_roles
    from nbv.files import open_array, read_json

    given, output, params = snakemake.input, snakemake.output, snakemake.params
    splits, object_ids = read_splits(given.splits), read_json(given.objects)
    features = open_array(given.features)
    settings, plane = params.estimator, params.mirror_plane_deg
    for place, fold in enumerate(params.folds):
        fitted, outputs = fit_fold(features, object_ids, splits, fold, settings, plane)
        trained_on = objects_with_role(splits, fold, *training_roles(splits))
        fitted.save(output.estimator[place], settings, trained_on)
        distributions = bool(output.get("test_posteriors"))
        files = {name: of_folds[place] for name, of_folds in output.items()}
        write_fold(files, estimates_of(outputs, distributions=distributions))

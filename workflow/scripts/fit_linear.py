"""Fit the linear estimator of one fold to depth features, and estimate held-out objects."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.estimates import write_fold
    from nbv.experiment.estimation.linear import fit_fold
    from nbv.experiment.estimation.outputs import estimates_of
    from nbv.experiment.splits import objects_with_role, read_splits, training_roles
    from nbv.files import open_array, read_json

    given, output, params = snakemake.input, snakemake.output, snakemake.params
    splits, fold = read_splits(given.splits), int(snakemake.wildcards.fold)
    fitted, outputs = fit_fold(
        open_array(given.features),
        read_json(given.objects),
        splits,
        fold,
        params.estimator,
        params.mirror_plane_deg,
    )
    trained_on = objects_with_role(splits, fold, *training_roles(splits))
    fitted.save(output.estimator, params.estimator, trained_on)
    distributions = bool(output.get("test_posteriors"))
    write_fold(output, estimates_of(outputs, distributions=distributions))

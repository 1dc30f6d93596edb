"""Choose rotation and elevation of the second view together, for one category and fold."""

from nbv.experiment.jobs import job

with job(snakemake):
    from nbv.experiment.view_sphere import view_sphere_rows
    from studies.extensions import stored_evidence

    from nbv.experiment.estimates import read_estimates
    from nbv.experiment.splits import need_role, read_splits
    from nbv.files import read_csv, write_csv

    params, fold = snakemake.params, int(snakemake.wildcards.fold)
    splits = read_splits(snakemake.input.splits)
    tests, evidences = {}, {}
    for position, elevation in enumerate(params.elevations):
        calibration = read_estimates(snakemake.input.calibration[position])
        tests[elevation] = read_estimates(snakemake.input.test[position])
        need_role(splits, fold, "calibration", calibration.object_ids)
        need_role(splits, fold, "test", tests[elevation].object_ids)
        choices = read_csv(snakemake.input.choices[position])
        evidences[elevation] = stored_evidence(calibration, choices, params.density)
    write_csv(snakemake.output[0], view_sphere_rows(tests, evidences, params.more_views))

"""Evaluate one setting of the ablation on every fold of a category."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.ablation import ablate

    from nbv.experiment.estimates import read_estimates
    from nbv.files import write_csv

    params, errors = snakemake.params, []
    pairs = zip(snakemake.input.calibration, snakemake.input.test, params.folds, strict=True)
    for calibration, test, fold in pairs:
        estimates = read_estimates(calibration), read_estimates(test)
        errors.append(ablate(*estimates, params.instance, params.density).assign(fold=fold))
    write_csv(snakemake.output[0], pd.concat(errors))

"""Train the estimator of one category, elevation and fold, or of the parts but one of a fold."""

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.splits import objects_with_role, read_splits, training_roles
    from nbv.estimation.hardware import choose_hardware, use_one_thread
    from nbv.estimation.training import train_estimator
    from nbv.estimation.weights import save_estimator
    from nbv.files import open_array
    from nbv.seeds import seed_for

    params, wildcards = snakemake.params, snakemake.wildcards
    use_one_thread()
    splits = read_splits(snakemake.input.splits)
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    part = wildcards.get("part")
    roles = training_roles(splits, without=None if part is None else int(part))
    chosen = objects_with_role(splits, int(wildcards.fold), *roles)
    estimator = train_estimator(
        open_array(snakemake.input.depth),
        chosen.rows,
        chosen.ids,
        params.estimator,
        hardware,
        seed_for(params.seed, "train", *wildcards),
    )
    save_estimator(snakemake.output[0], estimator, hardware)

"""Estimate every view of the calibration and the test objects of one fold."""

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.folds import objects_with_role, read_splits
    from nbv.calibration.pairs import write_estimates
    from nbv.estimation.hardware import choose_hardware, use_one_thread
    from nbv.estimation.inference import estimate_objects
    from nbv.estimation.weights import load_estimator
    from nbv.files import open_array

    params = snakemake.params
    use_one_thread()
    hardware = choose_hardware(params.device, params.precision)
    estimator = load_estimator(snakemake.input.estimator, hardware)
    splits = read_splits(snakemake.input.splits)
    depth = open_array(snakemake.input.depth)
    for role in ("calibration", "test"):
        chosen = objects_with_role(splits, int(snakemake.wildcards.fold), role)
        write_estimates(
            snakemake.output[role],
            chosen.ids,
            *estimate_objects(estimator, depth, chosen.rows, chosen.ids, hardware),
        )

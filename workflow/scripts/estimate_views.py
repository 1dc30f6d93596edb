"""Estimate every view of the calibration and the test objects of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimates import write_fold
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.inference import estimate_fold
    from nbv.experiment.estimation.weights import load_estimator
    from nbv.experiment.splits import read_splits

    params, given, output = snakemake.params, snakemake.input, snakemake.output
    use_one_thread()
    hardware = choose_hardware(params.device, params.precision)
    estimates = estimate_fold(
        open_depth(given.depth, given.objects),
        read_splits(given.splits),
        int(snakemake.wildcards.fold),
        load_estimator(given.estimator, hardware),
        [load_estimator(path, hardware) for path in given.of_parts],
        hardware,
        distributions=bool(output.get("test_posteriors")),
    )
    write_fold(output, estimates)

"""Estimate every view of the calibration and the test objects of one fold."""

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.calibration.estimates import write_estimates
    from nbv.calibration.posteriors import fit_temperature, write_posteriors
    from nbv.calibration.splits import calibration_roles, objects_with_role, read_splits
    from nbv.estimation.hardware import choose_hardware, use_one_thread
    from nbv.estimation.inference import decode, outputs_of_parts
    from nbv.estimation.weights import load_estimator
    from nbv.files import open_array

    params, given, output = snakemake.params, snakemake.input, snakemake.output
    use_one_thread()
    hardware = choose_hardware(params.device, params.precision)
    tested = load_estimator(given.estimator, hardware)
    of_parts = [load_estimator(path, hardware) for path in given.of_parts] or [tested]
    splits, fold = read_splits(given.splits), int(snakemake.wildcards.fold)
    depth = open_array(given.depth)
    parts = [objects_with_role(splits, fold, role) for role in calibration_roles(splits)]
    answered = {
        "calibration": outputs_of_parts(of_parts, depth, parts, hardware),
        "test": outputs_of_parts(
            [tested], depth, [objects_with_role(splits, fold, "test")], hardware
        ),
    }
    temperature = 1.0
    if output.get("test_posteriors"):
        azimuth_deg = np.linspace(0, 360, depth.shape[1], endpoint=False)
        temperature = fit_temperature(answered["calibration"][1], azimuth_deg)
    for role, (object_ids, outputs) in answered.items():
        write_estimates(output[role], object_ids, *decode(tested, outputs, temperature))
        if posteriors := output.get(f"{role}_posteriors"):
            write_posteriors(posteriors, object_ids, outputs, temperature)

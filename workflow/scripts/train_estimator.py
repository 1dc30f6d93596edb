"""Train the estimator of one category, elevation and fold, or of all parts but one of a fold.

A fold's estimator then estimates the calibration and the test objects, where the rule has these
outputs.
"""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.core.seeds import seed_for
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimates import write_fold
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.inference import estimate_fold
    from nbv.experiment.estimation.training import train_estimator
    from nbv.experiment.estimation.weights import load_estimator, read_start, save_estimator
    from nbv.experiment.splits import check_objects, objects_with_role, read_splits, training_roles

    params, wildcards = snakemake.params, snakemake.wildcards
    given, output = snakemake.input, snakemake.output
    use_one_thread()
    splits, images = read_splits(given.splits), open_depth(given.depth, given.objects)
    check_objects(splits, images.object_ids)
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    fold, part = int(wildcards.fold), wildcards.get("part")
    roles = training_roles(splits, without=None if part is None else int(part))
    object_ids = objects_with_role(splits, fold, *roles)
    starts = [
        read_start(path, wildcards.category, object_ids, output.estimator, hardware)
        for path in given.start
    ]
    estimator = train_estimator(
        images,
        object_ids,
        params.estimator,
        hardware,
        seed_for(params.seed, "train", *wildcards),
        start=starts[0] if starts else None,
        mirror_plane_deg=params.mirror_plane_deg,
    )
    save_estimator(output.estimator, estimator, hardware)
    if output.get("test"):
        # Estimates come from the saved weights.
        saved = load_estimator(output.estimator, hardware)
        distributions = bool(output.get("test_posteriors"))
        estimates = estimate_fold(
            images, splits, fold, saved, [], hardware, distributions=distributions
        )
        write_fold(output, estimates)

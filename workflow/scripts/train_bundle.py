"""Train the network of a bundle on all elevations of one fold's training objects."""

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.calibration.splits import need_objects, objects_with_role, read_splits
    from nbv.depth_images import DepthImages, open_depth
    from nbv.estimation.hardware import choose_hardware, use_one_thread
    from nbv.estimation.training import train_estimator
    from nbv.estimation.weights import save_estimator
    from nbv.seeds import seed_for

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    use_one_thread()
    splits = read_splits(given.splits)
    object_ids = objects_with_role(splits, params.fold, "train")
    names: list[str] = []
    codes = []
    for place, paths in enumerate(zip(given.depth, given.objects, strict=True)):
        images = open_depth(*paths)
        need_objects(splits, images.object_ids)
        names += [f"{object_id}/{place}" for object_id in object_ids]
        codes.append(images.of(object_ids))
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    estimator = train_estimator(
        DepthImages(tuple(names), np.concatenate(codes)),
        names,
        params.estimator,
        hardware,
        seed_for(params.seed, "bundle", wildcards.category),
    )
    save_estimator(snakemake.output[0], estimator, hardware)

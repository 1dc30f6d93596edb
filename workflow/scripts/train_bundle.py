"""Train the network of a bundle on all elevations of one fold's training objects."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.core.seeds import seed_for
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.training import train_network
    from nbv.experiment.estimation.weights import Estimator, read_start, save_estimator
    from nbv.experiment.splits import objects_with_role, read_splits

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    use_one_thread()
    splits = read_splits(given.splits)
    object_ids = objects_with_role(splits, params.fold, "train")
    opened = [open_depth(*paths) for paths in zip(given.depth, given.objects, strict=True)]
    # A single copy, filled elevation by elevation: it may exceed a gigabyte.
    codes = np.empty((len(opened), len(object_ids), *opened[0].codes.shape[1:]), dtype=np.uint8)
    for of_elevation, images in zip(codes, opened, strict=True):
        of_elevation[:] = images.of(object_ids)
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    # Replicate 0 is the bundle itself.
    replicate = [params.replicate] if params.replicate else []
    images = codes.reshape(-1, *codes.shape[2:])
    plane_deg = params.mirror_plane_deg
    starts = [
        read_start(path, wildcards.category, object_ids, snakemake.output[0], hardware)
        for path in given.start
    ]
    network = train_network(
        images,
        params.estimator,
        hardware,
        seed_for(params.seed, "bundle", wildcards.category, *replicate),
        start=starts[0].weights if starts else None,
        mirror_planes_deg=None if plane_deg is None else [plane_deg] * len(images),
    )
    names = [f"{name}/{place}" for place in range(len(opened)) for name in object_ids]
    origin = starts[0].origin if starts else None
    estimator = Estimator(network, params.estimator, codes.shape[-1], names, origin)
    save_estimator(snakemake.output[0], estimator, hardware)

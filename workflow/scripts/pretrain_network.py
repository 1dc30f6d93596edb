"""Train one network on the training objects that all categories have in a fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.core.seeds import seed_for
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.training import train_network
    from nbv.experiment.estimation.weights import Estimator, save_estimator, with_category
    from nbv.experiment.splits import check_objects, objects_with_role, read_splits, training_roles

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    use_one_thread()
    part = wildcards.get("part")
    names: list[str] = []
    planes_deg: list[float | None] = []
    codes = []
    for category, plane_deg, splits_path, *depth_paths in zip(
        params.categories,
        params.mirror_planes_deg,
        given.splits,
        given.depth,
        given.objects,
        strict=True,
    ):
        splits, images = read_splits(splits_path), open_depth(*depth_paths)
        check_objects(splits, images.object_ids)
        roles = training_roles(splits, without=None if part is None else int(part))
        object_ids = objects_with_role(splits, int(wildcards.fold), *roles)
        names += with_category(category, object_ids)
        planes_deg += [plane_deg] * len(object_ids)
        codes.append(images.of(object_ids))
    images = np.concatenate(codes)
    hardware = choose_hardware(params.estimator["device"], params.estimator["precision"])
    network = train_network(
        images,
        params.estimator,
        hardware,
        seed_for(params.seed, "pretrain", *wildcards),
        # One batch holds all categories, so that all are mirrored or none.
        mirror_planes_deg=None if None in planes_deg else planes_deg,
    )
    estimator = Estimator(network, params.estimator, images.shape[-1], names)
    save_estimator(snakemake.output[0], estimator, hardware)

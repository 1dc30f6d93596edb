"""Make a bundle of a network and its calibration with held-out objects; test it on others."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import json
    import logging
    from pathlib import Path

    from nbv.bundles.evaluation import evaluate
    from nbv.bundles.network import find_mirror_plane
    from nbv.data.camera import Camera
    from nbv.data.depth_images import open_depth
    from nbv.experiment.estimation.hardware import choose_hardware, use_one_thread
    from nbv.experiment.estimation.make_bundle import bundled_network, make_bundle, sweeps_of
    from nbv.experiment.estimation.weights import load_estimator
    from nbv.experiment.splits import objects_with_role, read_splits
    from nbv.files import write_csv

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    use_one_thread()
    hardware = choose_hardware("cpu", "float32")
    estimator = load_estimator(given.estimator, hardware)
    splits = read_splits(given.splits)
    images, test_images = (
        [open_depth(*paths) for paths in zip(depth, objects, strict=True)]
        for depth, objects in (
            (given.depth, given.objects),
            (given.test_depth, given.test_objects),
        )
    )
    calibration, test = (
        objects_with_role(splits, params.fold, role) for role in ("calibration", "test")
    )
    network = bundled_network(estimator)
    # A view every 15 degrees, as on a turntable.
    step = 15
    plain, *_ = sweeps_of(network, images, params.elevations, calibration, step)
    plane_deg = find_mirror_plane(network, plain)
    where = "none" if plane_deg is None else f"at an azimuth of {plane_deg:g}°"
    logging.getLogger("nbv").info("mirror plane of the objects: %s", where)
    network = bundled_network(estimator, plane_deg)
    sweeps, *extent_px = sweeps_of(network, images, params.elevations, calibration)
    bundle = make_bundle(
        wildcards.category,
        estimator,
        sweeps,
        tuple(extent_px),
        mirror_plane_deg=plane_deg,
        camera=Camera(**params.camera),
        sensor=params.sensor,
        affinity=params.affinity,
        provenance=json.loads(Path(given.provenance).read_text(encoding="utf-8"))
        | {"settings": params.settings},
    )
    bundle.save(snakemake.output.bundle)
    tested, *_ = sweeps_of(network, test_images, params.elevations, test, step)
    write_csv(snakemake.output.evaluation, evaluate(bundle, tested, n_views=(2, 3)))

"""Put a network and what held-out objects teach about it into one file; test it on others."""

from nbv.jobs import job

with job(snakemake):
    import json
    from pathlib import Path

    from nbv.bundles.bundle import save_bundle
    from nbv.bundles.evaluation import evaluate
    from nbv.bundles.making import make_bundle, turns_of
    from nbv.bundles.turns import every
    from nbv.calibration.splits import objects_with_role, read_splits
    from nbv.depth_images import open_depth
    from nbv.estimation.hardware import choose_hardware, use_one_thread
    from nbv.estimation.weights import load_estimator
    from nbv.files import write_csv
    from nbv.rendering.camera import Camera

    params, wildcards, given = snakemake.params, snakemake.wildcards, snakemake.input
    use_one_thread()
    hardware = choose_hardware("cpu", "float32")
    estimator = load_estimator(given.estimator, hardware)
    splits = read_splits(given.splits)
    of_role = {
        role: turns_of(
            estimator,
            [open_depth(*paths) for paths in zip(depth, objects, strict=True)],
            params.elevations,
            objects_with_role(splits, params.fold, role),
        )
        for role, depth, objects in (
            ("calibration", given.depth, given.objects),
            ("test", given.test_depth, given.test_objects),
        )
    }
    turns, *extent_px = of_role["calibration"]
    bundle = make_bundle(
        wildcards.category,
        estimator,
        turns,
        tuple(extent_px),
        camera=Camera(**params.camera),
        sensor=params.sensor,
        affinity=params.affinity,
        provenance=json.loads(Path(given.provenance).read_text(encoding="utf-8"))
        | {"settings": params.settings},
    )
    save_bundle(snakemake.output.bundle, bundle)
    # As on a turntable: a view every 15 degrees.
    found = evaluate(bundle, [every(turn, 15) for turn in of_role["test"][0]], n_views=(2, 3))
    write_csv(snakemake.output.evaluation, found)

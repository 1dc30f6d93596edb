"""Render a sweep of each object of one category near one elevation, as a real camera sees it."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from dataclasses import replace

    import numpy as np

    from nbv.core.seeds import rng_for
    from nbv.data.camera import Camera
    from nbv.data.depth_images import write_depth
    from nbv.data.meshes import load_meshes
    from nbv.data.randomisation import Randomisation, randomised_sweep
    from nbv.data.render import N_AZIMUTHS, open_renderer
    from nbv.data.sensors import IDEAL, build_sensor
    from nbv.experiment.splits import objects_with_role, read_splits, seen_at

    params, wildcards, output = snakemake.params, snakemake.wildcards, snakemake.output
    camera = Camera(**params.camera)
    renderer = open_renderer(params.renderer["name"])
    name = params.sensor["name"]
    sensor = None if name == IDEAL else build_sensor(name, params.sensor["parameters"])
    meshes = load_meshes(snakemake.input.meshes)
    splits = read_splits(snakemake.input.splits)
    trained, calibrated, tested = (
        objects_with_role(splits, params.fold, role) for role in ("train", "calibration", "test")
    )
    place, n_places = params.elevations.index(int(wildcards.elevation)), len(params.elevations)
    calibrated = seen_at(calibrated, place, n_places, params.calibration_turns)
    # A bundle is calibrated and tested on what its camera measures.
    learnt = Randomisation(**params.randomisation)
    randomisation = dict.fromkeys(trained, learnt)
    randomisation |= dict.fromkeys([*calibrated, *tested], replace(learnt, measured=1.0))
    images = (
        randomised_sweep(
            meshes[object_id],
            float(wildcards.elevation),
            np.arange(N_AZIMUTHS, dtype=np.float64) * (360.0 / N_AZIMUTHS),
            camera,
            renderer,
            sensor,
            params.sensor["diagonal_m"][wildcards.category],
            drawn,
            rng_for(params.seed, "bundle", wildcards.category, int(wildcards.elevation), object_id),
        )
        for object_id, drawn in randomisation.items()
    )
    shape = N_AZIMUTHS, camera.image_side, camera.image_side
    write_depth(output.depth, output.objects, randomisation, images, shape)

"""Render a turn of each object of one category near one elevation, as a real camera sees it."""

from nbv.experiment.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.core.seeds import rng_for
    from nbv.data.camera import Camera
    from nbv.data.depth_images import write_depth
    from nbv.data.meshes import load_meshes
    from nbv.data.randomisation import Randomisation, randomised_sweep
    from nbv.data.render import N_AZIMUTHS, open_renderer
    from nbv.data.sensors import IDEAL, build_sensor

    params, wildcards, output = snakemake.params, snakemake.wildcards, snakemake.output
    camera = Camera(**params.camera)
    renderer = open_renderer(params.renderer["name"])
    name = params.sensor["name"]
    sensor = None if name == IDEAL else build_sensor(name, params.sensor["parameters"])
    meshes = load_meshes(snakemake.input.meshes)
    images = (
        randomised_sweep(
            mesh,
            float(wildcards.elevation),
            np.arange(N_AZIMUTHS, dtype=np.float64) * (360.0 / N_AZIMUTHS),
            camera,
            renderer,
            sensor,
            params.sensor["diagonal_m"][wildcards.category],
            Randomisation(**params.randomisation),
            rng_for(params.seed, "bundle", wildcards.category, int(wildcards.elevation), object_id),
        )
        for object_id, mesh in meshes.items()
    )
    shape = N_AZIMUTHS, camera.image_side, camera.image_side
    write_depth(output.depth, output.objects, meshes, images, shape)

"""Render a full sweep of each object of one category at one elevation."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.data.camera import Camera
    from nbv.data.depth_images import write_depth
    from nbv.data.meshes import load_meshes
    from nbv.data.render import N_AZIMUTHS, open_renderer, render_objects
    from nbv.data.sensors import open_sensor

    params, wildcards, output = snakemake.params, snakemake.wildcards, snakemake.output
    camera = Camera(**params.camera)
    meshes = load_meshes(snakemake.input.meshes)
    n_azimuths = params.get("n_azimuths", N_AZIMUTHS)
    images = render_objects(
        meshes,
        float(wildcards.elevation),
        camera,
        open_renderer(params.renderer["name"]),
        open_sensor(params.sensor, camera, wildcards.category, int(wildcards.elevation)),
        n_azimuths,
    )
    shape = n_azimuths, camera.image_side, camera.image_side
    write_depth(output.depth, output.objects, meshes, images, shape)

"""Render a full turn of each object of one category at one elevation."""

from nbv.jobs import job

with job(snakemake):
    from nbv.depth_images import write_depth
    from nbv.meshes.store import load_meshes
    from nbv.rendering import open_renderer
    from nbv.rendering.camera import Camera
    from nbv.rendering.noise import open_sensor
    from nbv.rendering.render import N_AZIMUTHS, render_objects

    params, wildcards, output = snakemake.params, snakemake.wildcards, snakemake.output
    camera = Camera(**params.camera)
    meshes = load_meshes(snakemake.input.meshes)
    images = render_objects(
        meshes,
        float(wildcards.elevation),
        camera,
        open_renderer(params.renderer["name"]),
        open_sensor(params.sensor, camera, wildcards.category, int(wildcards.elevation)),
    )
    shape = N_AZIMUTHS, camera.image_side, camera.image_side
    write_depth(output.depth, output.objects, meshes, images, shape)

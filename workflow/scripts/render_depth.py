"""Render a full turn of each object of one category at one elevation."""

from nbv.jobs import job

with job(snakemake):
    from nbv.meshes.store import load_meshes
    from nbv.rendering import open_renderer
    from nbv.rendering.camera import Camera
    from nbv.rendering.noise import open_sensor
    from nbv.rendering.render import write_depth

    params, wildcards = snakemake.params, snakemake.wildcards
    camera = Camera(**params.camera)
    write_depth(
        snakemake.output[0],
        load_meshes(snakemake.input.meshes),
        float(wildcards.elevation),
        camera,
        open_renderer(params.renderer["name"]),
        open_sensor(params.sensor, camera, wildcards.category, int(wildcards.elevation)),
    )

"""Render each object of one category in random orientations."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.rotation_estimator import orientations_of, oriented_views

    from nbv.data.camera import Camera
    from nbv.data.depth_images import write_depth
    from nbv.data.meshes import load_meshes
    from nbv.data.render import open_renderer

    params, output = snakemake.params, snakemake.output
    category, settings = snakemake.wildcards.category, params.settings
    camera, renderer = Camera(**params.camera), open_renderer(params.renderer["name"])
    meshes = load_meshes(snakemake.input.meshes)
    n_orientations, n_views = settings["turns"], settings["views"]
    images = (
        oriented_views(
            mesh,
            orientations_of(name, category, n_orientations, params.seed),
            n_views,
            camera,
            renderer,
        )
        for name, mesh in meshes.items()
    )
    shape = n_orientations * n_views, camera.image_side, camera.image_side
    write_depth(output.depth, output.objects, meshes, images, shape)

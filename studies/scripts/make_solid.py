"""Make a solid that has a symmetry group, as objects that are all the same."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.solids import solid

    from nbv.data.meshes import normalise, save_meshes

    name = snakemake.wildcards.category
    mesh = normalise(solid(name)[0], "+z", "+x", 0.0, "box")
    save_meshes(
        snakemake.output[0], {f"{name}-{i}": mesh for i in range(snakemake.params.n_objects)}
    )

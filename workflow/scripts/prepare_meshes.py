"""Load, check and normalise the chosen objects of one category."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.data.meshes import save_meshes
    from nbv.data.sources import open_source, prepare_meshes

    params = snakemake.params
    source = open_source(params.dataset, params.seed)
    meshes = prepare_meshes(source, snakemake.wildcards.category, params.objects)
    save_meshes(snakemake.output[0], meshes)

"""Load, check and normalise the chosen objects of one category."""

from nbv.jobs import job

with job(snakemake):
    from nbv.meshes.preparation import prepare_meshes
    from nbv.meshes.sources import open_source
    from nbv.meshes.store import save_meshes

    params = snakemake.params
    source = open_source(params.dataset, params.seed)
    meshes = prepare_meshes(source, snakemake.wildcards.category, params.objects)
    save_meshes(snakemake.output[0], meshes)

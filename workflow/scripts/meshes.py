"""Load, check and normalise the chosen objects of one category."""

from nbv.jobs import job

with job(snakemake):
    from nbv.meshes.preparation import prepare_meshes
    from nbv.meshes.sources import open_source, select_objects
    from nbv.meshes.store import save_meshes

    params, category = snakemake.params, snakemake.wildcards.category
    source = open_source(params.dataset, params.seed)
    chosen = select_objects(source, category, params.n_objects)
    save_meshes(
        snakemake.output[0], prepare_meshes(source, category, chosen, workers=snakemake.threads)
    )

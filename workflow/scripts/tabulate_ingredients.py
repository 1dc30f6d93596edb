"""Compare bundles that lack an ingredient of the randomisation with the one that has all."""

from nbv.jobs import job

with job(snakemake):
    import logging

    from nbv.bundles.bundle import load_bundle
    from nbv.bundles.evaluation import evaluate
    from nbv.bundles.manifest import read_manifest, see
    from nbv.bundles.recommender import Recommender
    from nbv.files import read_csv
    from nbv.frames.errors import FrameError
    from nbv.reporting.ingredients import ingredient_table
    from nbv.reporting.table import write_table
    from nbv.seeds import rng_for
    from nbv.statistics.paired import Resampler

    params, given = snakemake.params, snakemake.input
    log = logging.getLogger("nbv")

    def left_out(path: str, error: FrameError) -> None:
        log.info("%s is left out: %s", path, error)

    keys = [tuple(key) for key in params.bundles]
    rendered = {key: read_csv(path) for key, path in zip(keys, given.evaluations, strict=True)}
    real = {}
    if given.frames:
        recordings = read_manifest(given.frames[0])
        for key, path in zip(keys, given.bundles, strict=True):
            recommender = Recommender(load_bundle(path), "numpy")
            turns = [see(recommender, one, None, None, left_out) for one in recordings]
            real[key] = evaluate(recommender.bundle, turns, n_views=(2,))
    rng = rng_for(params.seed, "ingredients")
    table = ingredient_table(rendered, real, Resampler.seeded(rng, params.n_resamples))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

"""Compare bundles that lack an ingredient of the randomisation with the one that has all."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import logging

    import pandas as pd
    from studies.ingredients import ingredient_table

    from nbv.bundles.evaluation import evaluate
    from nbv.bundles.recommender import Recommender
    from nbv.bundles.recordings import read_manifest, run_network
    from nbv.errors import FrameError
    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv

    params, given = snakemake.params, snakemake.input
    log = logging.getLogger("nbv")

    def left_out(path: str, error: FrameError) -> None:
        log.info("%s is left out: %s", path, error)

    keys = [(category, without) for category, without, _ in params.compared]
    rendered: dict[tuple[str, str], list[pd.DataFrame]] = {}
    for key, path in zip(keys, given.evaluations, strict=True):
        rendered.setdefault(key, []).append(read_csv(path))
    real: dict[tuple[str, str], list[pd.DataFrame]] = {}
    if given.frames:
        recordings = read_manifest(given.frames[0])
        for key, path in zip(keys, given.bundles, strict=True):
            recommender = Recommender.load(path)
            sweeps = [run_network(recommender, each, None, None, left_out) for each in recordings]
            real.setdefault(key, []).append(evaluate(recommender.bundle, sweeps, n_views=(2,)))
    table = ingredient_table(rendered, real)
    write_table(table, dict(snakemake.output.items()), params.caution)

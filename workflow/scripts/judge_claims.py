"""Judge each of the paper's claims by the results."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.experiments.results import load_evaluations
    from nbv.paper.verdicts import evaluate_claims
    from nbv.reporting.paper.claims import claims_table
    from nbv.reporting.table import write_table

    given, params = snakemake.input, snakemake.params
    files = zip(params.evaluations, map(Path, given.evaluations), strict=True)
    rng = np.random.default_rng(params.seed)
    claims = evaluate_claims(load_evaluations(dict(files)), rng, params.n_resamples)
    write_table(claims_table(claims), dict(snakemake.output.items()), snakemake.params.caution)

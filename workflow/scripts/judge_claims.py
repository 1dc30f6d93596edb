"""Judge each of the paper's claims by the results."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.experiment.paper.verdicts import evaluate_claims
    from nbv.experiment.report.table import write_table
    from nbv.experiment.report.tables import claims_table
    from nbv.experiment.results import load_evaluations

    given, params = snakemake.input, snakemake.params
    files = zip(params.evaluations, map(Path, given.evaluations), strict=True)
    rng = np.random.default_rng(params.seed)
    claims = evaluate_claims(load_evaluations(dict(files)), rng, params.n_resamples)
    write_table(claims_table(claims), dict(snakemake.output.items()), snakemake.params.caution)

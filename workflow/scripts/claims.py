"""Hold each of the paper's claims against the results."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    import numpy as np

    from nbv.experiments.results import load_evaluations
    from nbv.files import write_csv, write_text
    from nbv.paper.verdicts import evaluate_claims
    from nbv.reporting.paper.claims import claims_markdown

    params, results = snakemake.params, Path(snakemake.output[0]).parent
    evaluations = load_evaluations(results, params.units, params.n_folds, params.reading["methods"])
    rng = np.random.default_rng(params.reading["seed"])
    claims = evaluate_claims(evaluations, rng, params.reading["n_resamples"])
    write_csv(snakemake.output.csv, claims)
    write_text(snakemake.output.md, claims_markdown(claims))

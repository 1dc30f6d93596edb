"""Keep the held-out estimates of one training of every fold in one file."""

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.kept_estimates import keep_estimates, read_held_out

    params, given = snakemake.params, snakemake.input
    posteriors = given.get("posteriors") or [None] * len(params.keys)
    keep_estimates(
        snakemake.output[0],
        {
            tuple(key): read_held_out(*paths)
            for key, *paths in zip(params.keys, given.estimates, posteriors, strict=True)
        },
        params.configuration,
    )

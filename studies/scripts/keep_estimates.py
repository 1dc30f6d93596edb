"""Keep the held-out estimates of one training of every fold in one file."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.kept_estimates import keep_estimates, read_held_out

    params, given, wildcards = snakemake.params, snakemake.input, snakemake.wildcards
    training = int(wildcards.shuffle), int(wildcards.replicate)
    posteriors = given.get("posteriors") or [None] * len(params.held_out)
    keep_estimates(
        snakemake.output[0],
        {
            (*training, *key): read_held_out(*paths)
            for key, *paths in zip(params.held_out, given.estimates, posteriors, strict=True)
        },
        params.configuration,
    )

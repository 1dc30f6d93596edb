"""Evaluate the extensions on the test objects of one fold."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.extensions import evaluate_extensions
    from studies.object_errors import object_means

    from nbv.core.seeds import rng_for
    from nbv.experiment.estimates import read_estimates, read_posteriors
    from nbv.experiment.splits import check_role, read_splits
    from nbv.files import read_csv, write_csv
    from nbv.tables.lookup import LookupTable

    given, output = snakemake.input, snakemake.output
    params, wildcards = snakemake.params, snakemake.wildcards
    splits, posteriors = read_splits(given.splits), {}
    estimates = {role: read_estimates(given[role]) for role in ("calibration", "test")}
    for role, of_role in estimates.items():
        check_role(splits, int(wildcards.fold), role, of_role.object_ids)
        if path := given.get(f"{role}_posteriors"):
            posteriors[f"{role}_posteriors"] = read_posteriors(path, of_role.object_ids)
    made = evaluate_extensions(
        estimates["calibration"],
        estimates["test"],
        params.extensions,
        params.density,
        lambda name: rng_for(params.seed, name, *wildcards),
        **posteriors,
    )
    for name, path in zip(params.extensions, output.evaluations, strict=True):
        write_csv(path, made.frames[name])
    for name, path in zip(params.lookups, output.lookups, strict=True):
        LookupTable.of(made.lookups[name]).save(path)
    write_csv(output.choices, made.choices)
    methods = dict(zip(params.methods, map(read_csv, given.methods), strict=True))
    write_csv(output.objects, object_means(methods | made.frames))
    write_csv(output.travel, made.travel, decimals=6)

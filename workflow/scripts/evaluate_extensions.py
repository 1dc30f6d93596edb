"""Let methods beyond the paper contend on one fold."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.calibration.estimates import read_estimates
    from nbv.calibration.splits import assert_role, read_splits
    from nbv.experiments.travel import travel_rows
    from nbv.experiments.two_views import evaluate_entry
    from nbv.files import read_csv, write_csv
    from nbv.recommendation.lookup import save_lookup
    from nbv.recommendation.method_selection import choices_frame, enter
    from nbv.seeds import rng_for
    from nbv.statistics.object_means import object_means

    params, wildcards = snakemake.params, snakemake.wildcards
    splits = read_splits(snakemake.input.splits)
    estimates = {role: read_estimates(snakemake.input[role]) for role in ("calibration", "test")}
    for role, found in estimates.items():
        assert_role(splits, int(wildcards.fold), role, found.object_ids)
    entries = enter(estimates["calibration"], params.contenders, params.density)
    frames = {Path(path).stem: read_csv(path) for path in snakemake.input.paper}
    for path in snakemake.output.evaluations:
        name = Path(path).stem
        rng = rng_for(params.seed, name, *wildcards)
        frames[name] = evaluate_entry(entries[name], estimates["test"], rng)
        write_csv(path, frames[name])
    for path in snakemake.output.lookups:
        save_lookup(path, entries[Path(path).stem].lookup)
    write_csv(snakemake.output.choices, choices_frame(entries))
    write_csv(snakemake.output.objects, object_means(frames))
    write_csv(snakemake.output.travel, travel_rows(entries, estimates["test"]), decimals=6)

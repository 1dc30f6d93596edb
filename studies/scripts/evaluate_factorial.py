"""Evaluate every choice with every fusion on the test objects of one unit, after one training."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.confirmation import factorial_beliefs, factorial_objects
    from studies.factorial import evaluate_factorial, evaluate_more_views
    from studies.kept_estimates import kept_settings, read_kept

    from nbv.core.seeds import rng_for
    from nbv.files import write_csv

    wildcards, path = snakemake.wildcards, snakemake.input.kept
    settings, keys = kept_settings(path)
    place = (
        int(wildcards.shuffle),
        int(wildcards.replicate),
        wildcards.category,
        int(wildcards.elevation),
    )
    held = read_kept(path, [key for key in keys if key[:4] == place])
    decision = settings["density"] | settings["recommendation"]
    decision |= {"affinity": settings["affinity"]}
    parts = {"objects": [], "beliefs": [], "densities": []}
    for fold in dict.fromkeys(key[4] for key in held):
        objects = [held[*place, fold, role] for role in ("calibration", "test")]
        made = evaluate_factorial(
            *objects,
            decision,
            lambda name, fold=fold: rng_for(settings["seed"], name, *place, fold),
        )
        more = evaluate_more_views(
            *objects,
            made.posterior_density,
            decision,
            settings["more_views"],
            rng_for(settings["seed"], "more_views", *place, fold),
        )
        parts["objects"].append(factorial_objects(made, more).assign(fold=fold))
        parts["beliefs"].append(factorial_beliefs(more).assign(fold=fold))
        parts["densities"].append(made.densities.assign(fold=fold))
    for name, frames in parts.items():
        write_csv(snakemake.output[name], pd.concat(frames, ignore_index=True))

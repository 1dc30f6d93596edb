"""Evaluate every choice with every fusion on the test objects of one unit, after one training."""

from nbv.experiment.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.confirmation import factorial_beliefs, factorial_objects
    from studies.factorial import evaluate_factorial
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
    parts = {"objects": [], "beliefs": [], "densities": []}
    for fold in dict.fromkeys(key[4] for key in held):
        made = evaluate_factorial(
            held[*place, fold, "calibration"],
            held[*place, fold, "test"],
            decision | {"affinity": settings["affinity"]},
            settings["more_views"],
            lambda name, fold=fold: rng_for(settings["seed"], name, *place, fold),
        )
        parts["objects"].append(factorial_objects(made).assign(fold=fold))
        parts["beliefs"].append(factorial_beliefs(made).assign(fold=fold))
        parts["densities"].append(made.densities.assign(fold=fold))
    for name, frames in parts.items():
        write_csv(snakemake.output[name], pd.concat(frames, ignore_index=True))

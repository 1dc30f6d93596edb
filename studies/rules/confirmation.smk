# Trainings beyond the run's own, and what all of them say together.

# The folder of one training.
TRAINING = "<results>/confirmation/shuffle{shuffle}/replicate{replicate}"


use rule splits from paper as shuffle_splits with:
    output:
        "<results>/confirmation/shuffle{shuffle}/splits/{category}.csv",
    log:
        "<logs>/shuffle_splits/shuffle{shuffle}/{category}.log",
    benchmark:
        "<benchmarks>/shuffle_splits/shuffle{shuffle}/{category}.tsv"


use rule pretrain from paper as replicate_pretrain with:
    input:
        code=sources("pretrain_network"),
        splits=all_shuffled_splits,
        depth=paths("<results>/depth/{category}/el{elevation}.npy", PLAN.lowest_units),
        objects=paths(
            "<results>/depth/{category}/el{elevation}_objects.json", PLAN.lowest_units
        ),
    output:
        f"{TRAINING}/estimators/pretrained/fold{{fold}}/estimator.safetensors",
    log:
        "<logs>/replicate_pretrain/shuffle{shuffle}_replicate{replicate}/fold{fold}.log",
    benchmark:
        "<benchmarks>/replicate_pretrain/shuffle{shuffle}_replicate{replicate}/fold{fold}.tsv"


use rule pretrain from paper as replicate_pretrain_part with:
    input:
        code=sources("pretrain_network"),
        splits=all_shuffled_splits,
        depth=paths("<results>/depth/{category}/el{elevation}.npy", PLAN.lowest_units),
        objects=paths(
            "<results>/depth/{category}/el{elevation}_objects.json", PLAN.lowest_units
        ),
    output:
        f"{TRAINING}/estimators/pretrained/fold{{fold}}/without_part{{part}}.safetensors",
    log:
        "<logs>/replicate_pretrain_part/shuffle{shuffle}_replicate{replicate}/fold{fold}/{part}.log",
    benchmark:
        "<benchmarks>/replicate_pretrain_part/shuffle{shuffle}_replicate{replicate}/fold{fold}/{part}.tsv"


use rule train from paper as replicate_train with:
    input:
        code=sources("train_estimator"),
        splits=shuffled_splits,
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
        start=replicate_start,
    output:
        **estimates_of_training(TRAINING),
        estimator=f"{TRAINING}/estimators/{FOLD}/estimator.safetensors",
    log:
        "<logs>/replicate_train/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/replicate_train/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}.tsv"


use rule train from paper as replicate_train_part with:
    input:
        code=sources("train_estimator"),
        splits=shuffled_splits,
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
        start=replicate_start,
    output:
        estimator=f"{TRAINING}/estimators/{FOLD}/without_part{{part}}.safetensors",
    log:
        "<logs>/replicate_train_part/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}/{part}.log",
    benchmark:
        "<benchmarks>/replicate_train_part/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}/{part}.tsv"


use rule estimate from paper as replicate_estimate with:
    input:
        code=sources("estimate_views"),
        splits=shuffled_splits,
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
        estimator=f"{TRAINING}/estimators/{FOLD}/estimator.safetensors",
        of_parts=[
            f"{TRAINING}/estimators/{FOLD}/without_part{part}.safetensors"
            for part in PLAN.parts
        ],
    output:
        **estimates_of_fold(TRAINING),
    log:
        "<logs>/replicate_estimate/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/replicate_estimate/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}/fold{fold}.tsv"


if PLAN.linear:

    use rule fit from paper as replicate_fit with:
        input:
            code=sources("fit_linear"),
            splits=shuffled_splits,
            features="<results>/features/{category}/el{elevation}.npy",
            objects="<results>/depth/{category}/el{elevation}_objects.json",
        output:
            **fits_of_folds(TRAINING),
        log:
            "<logs>/replicate_fit/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.log",
        benchmark:
            "<benchmarks>/replicate_fit/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.tsv"


rule keep_estimates:
    input:
        code=sources("keep_estimates"),
        estimates=held_out_files(".csv"),
        posteriors=(
            held_out_files("_posteriors.npz") if CONFIG["gives_distributions"] else []
        ),
    output:
        "<results>/confirmation/kept/shuffle{shuffle}_replicate{replicate}.npz",
    log:
        "<logs>/keep_estimates/shuffle{shuffle}_replicate{replicate}.log",
    benchmark:
        "<benchmarks>/keep_estimates/shuffle{shuffle}_replicate{replicate}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        held_out=STUDIES.held_out,
        configuration=CONFIG,
    script:
        "../scripts/keep_estimates.py"


rule join_kept_estimates:
    input:
        code=sources("join_kept_estimates"),
        kept=paths(rules.keep_estimates.output[0], STUDIES.trainings),
    output:
        "<results>/confirmation/estimates.npz",
    log:
        "<logs>/join_kept_estimates.log",
    benchmark:
        "<benchmarks>/join_kept_estimates.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    script:
        "../scripts/join_kept_estimates.py"


rule evaluate_factorial:
    input:
        code=sources("evaluate_factorial"),
        kept=kept_file,
    output:
        objects="<results>/confirmation/objects/{run}/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.csv",
        beliefs="<results>/confirmation/beliefs/{run}/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.csv",
        densities="<results>/confirmation/densities/{run}/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.csv",
    log:
        "<logs>/evaluate_factorial/{run}/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/evaluate_factorial/{run}/shuffle{shuffle}_replicate{replicate}/{category}/el{elevation}.tsv"
    # A file of kept estimates may have categories and elevations that this run does not have.
    wildcard_constraints:
        category="[^/]+",
        elevation=r"\d\d",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(30),
    script:
        "../scripts/evaluate_factorial.py"


rule statistics:
    input:
        code=sources("tabulate_confirmation"),
        objects=factorial_files("objects"),
        beliefs=factorial_files("beliefs"),
        densities=factorial_files("densities"),
    output:
        **{
            f"{name}_csv": f"<results>/confirmation/{name}.csv"
            for name in ("methods", "contrasts", "trainings", "beliefs", "densities")
        },
        **{
            f"{name}_{kind}": f"<results>/confirmation/{name}.{kind}"
            for name in ("answers", "contrasts")
            for kind in ("png", "pdf", "svg")
        },
    log:
        "<logs>/statistics.log",
    benchmark:
        "<benchmarks>/statistics.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        places=lambda wildcards: dict.fromkeys(
            ("objects", "beliefs", "densities"), STUDIES.kept_trainings
        ),
    script:
        "../scripts/tabulate_confirmation.py"


rule confirm:
    input:
        rules.join_kept_estimates.output,
        rules.statistics.output,

# Lookup tables from calibration pairs, and the errors of each of the paper's methods.


rule lookup:
    input:
        sources("build_lookup"),
        splits=rules.splits.output[0],
        calibration=LAYOUT.estimates(*FOLD, "calibration"),
    output:
        LAYOUT.lookup(*FOLD, "{criterion}"),
    log:
        LAYOUT.log(f"lookup/{fold_folder(*FOLD)}/{{criterion}}"),
    benchmark:
        LAYOUT.benchmark(f"lookup/{fold_folder(*FOLD)}/{{criterion}}")
    conda:
        ENVIRONMENT
    params:
        density=DECISION,
    script:
        f"{SCRIPTS}/build_lookup.py"


rule evaluate_baselines:
    input:
        sources("evaluate_baselines"),
        splits=rules.splits.output[0],
        test=LAYOUT.estimates(*FOLD, "test"),
    output:
        [LAYOUT.evaluation(*FOLD, method) for method in BASELINE_METHODS],
    log:
        LAYOUT.log(f"evaluate_baselines/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_baselines/{fold_folder(*FOLD)}")
    conda:
        ENVIRONMENT
    params:
        methods={name: METHODS[name] for name in BASELINE_METHODS},
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/evaluate_baselines.py"


rule evaluate_recommended:
    input:
        sources("evaluate_recommended"),
        splits=rules.splits.output[0],
        test=LAYOUT.estimates(*FOLD, "test"),
        lookup=lambda wildcards: LAYOUT.lookup(
            wildcards.category,
            wildcards.elevation,
            wildcards.fold,
            METHODS[wildcards.method]["policy"],
        ),
    output:
        LAYOUT.evaluation(*FOLD, "{method}"),
    log:
        LAYOUT.log(f"evaluate_recommended/{fold_folder(*FOLD)}/{{method}}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_recommended/{fold_folder(*FOLD)}/{{method}}")
    conda:
        ENVIRONMENT
    params:
        method=lambda wildcards: METHODS[wildcards.method],
    script:
        f"{SCRIPTS}/evaluate_recommended.py"


rule lookups:
    input:
        [
            LAYOUT.lookup(*fold, criterion)
            for fold in folds_of(UNITS)
            for criterion in LOOKUP_CRITERIA
        ],


rule evaluation:
    input:
        rules.settings.output,
        paths(LAYOUT.evaluation, evaluations_of(UNITS)),

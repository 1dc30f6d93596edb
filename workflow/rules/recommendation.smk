# Lookup tables from calibration pairs, and the errors of each of the paper's methods.


rule lookup:
    input:
        code=sources("build_lookup"),
        splits="<results>/splits/{category}.csv",
        calibration="<results>/estimates/{category}/el{elevation}/fold{fold}/calibration.csv",
    output:
        "<results>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
    log:
        "<logs>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.log",
    benchmark:
        "<benchmarks>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.tsv"
    conda:
        ENVIRONMENT
    params:
        density=PLAN.decision,
    script:
        "../scripts/build_lookup.py"


rule evaluate_baselines:
    input:
        code=sources("evaluate_baselines"),
        splits="<results>/splits/{category}.csv",
        test="<results>/estimates/{category}/el{elevation}/fold{fold}/test.csv",
    output:
        expand(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            method=PLAN.baseline_methods,
            allow_missing=True,
        ),
    log:
        "<logs>/evaluate_baselines/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/evaluate_baselines/{category}/el{elevation}/fold{fold}.tsv"
    conda:
        ENVIRONMENT
    params:
        methods={name: METHODS[name] for name in PLAN.baseline_methods},
        seed=CONFIG["seed"],
    script:
        "../scripts/evaluate_baselines.py"


rule evaluate_recommended:
    input:
        code=sources("evaluate_recommended"),
        splits="<results>/splits/{category}.csv",
        test="<results>/estimates/{category}/el{elevation}/fold{fold}/test.csv",
        lookup=lambda wildcards: (
            "<results>/lookup/{category}/el{elevation}/fold{fold}/"
            f"{METHODS[wildcards.method]['policy']}.npz"
        ),
    output:
        "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
    log:
        "<logs>/evaluate_recommended/{category}/el{elevation}/fold{fold}/{method}.log",
    benchmark:
        "<benchmarks>/evaluate_recommended/{category}/el{elevation}/fold{fold}/{method}.tsv"
    conda:
        ENVIRONMENT
    params:
        method=lambda wildcards: METHODS[wildcards.method],
    script:
        "../scripts/evaluate_recommended.py"


rule lookups:
    input:
        paths(
            "<results>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
            PLAN.lookups,
        ),


rule evaluation:
    input:
        rules.settings.output,
        paths(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            PLAN.evaluations_of(UNITS),
        ),

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


# All methods in one job, whose start takes longer than its work.
rule evaluate:
    input:
        code=sources("evaluate_methods"),
        splits="<results>/splits/{category}.csv",
        test="<results>/estimates/{category}/el{elevation}/fold{fold}/test.csv",
        lookups=expand(
            "<results>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
            criterion=PLAN.lookup_criteria,
            allow_missing=True,
        ),
    output:
        expand(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            method=METHODS,
            allow_missing=True,
        ),
    log:
        "<logs>/evaluate/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/evaluate/{category}/el{elevation}/fold{fold}.tsv"
    conda:
        ENVIRONMENT
    params:
        methods=METHODS,
        criteria=PLAN.lookup_criteria,
        seed=CONFIG["seed"],
    script:
        "../scripts/evaluate_methods.py"


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

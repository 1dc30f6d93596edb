# Extensions on the same estimates: each with the density that suits it best.


rule evaluate_extensions:
    input:
        **estimates_of_fold(),
        code=sources("evaluate_extensions"),
        splits="<results>/splits/{category}.csv",
        methods=expand(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{name}.csv",
            name=METHODS,
            allow_missing=True,
        ),
    output:
        evaluations=expand(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{name}.csv",
            name=CONFIG["extensions"],
            allow_missing=True,
        ),
        lookups=expand(
            "<results>/lookup/{category}/el{elevation}/fold{fold}/{name}.npz",
            name=STUDIES.extension_lookups,
            allow_missing=True,
        ),
        choices="<results>/extensions/{category}/el{elevation}/fold{fold}/choices.csv",
        objects="<results>/extensions/{category}/el{elevation}/fold{fold}/objects.csv",
        travel="<results>/extensions/{category}/el{elevation}/fold{fold}/travel.csv",
    log:
        "<logs>/evaluate_extensions/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/evaluate_extensions/{category}/el{elevation}/fold{fold}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        methods=list(METHODS),
        extensions=CONFIG["extensions"],
        lookups=STUDIES.extension_lookups,
        density=STUDIES.decision,
        seed=CONFIG["seed"],
    script:
        "../scripts/evaluate_extensions.py"


rule extension_evaluations:
    input:
        "<results>/configuration.yaml",
        paths(
            "<results>/extensions/{category}/el{elevation}/fold{fold}/objects.csv",
            PLAN.folds_of(UNITS),
        ),

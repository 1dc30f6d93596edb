# Trained on × tested on: the same objects and folds, under other sensors or framings.

import itertools

TRANSFER_KEYS = [
    (trained, tested, fold, method)
    for trained, tested in itertools.product(CONFIG["transfer"]["conditions"], repeat=2)
    for fold in STUDIES.transfer_folds
    for method in METHODS
]


use rule render from paper as transfer_render with:
    input:
        code=lambda wildcards: sources(
            "render_depth", condition_of(wildcards.condition)
        ),
        meshes="<results>/meshes/{category}.npz",
    output:
        depth="<results>/transfer/{condition}/depth/{category}/el{elevation}.npy",
        objects="<results>/transfer/{condition}/depth/{category}/el{elevation}_objects.json",
    log:
        "<logs>/transfer/render/{condition}/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/transfer/render/{condition}/{category}/el{elevation}.tsv"
    params:
        camera=lambda wildcards: condition_of(wildcards.condition)["camera"],
        sensor=lambda wildcards: sensor_settings(
            condition_of(wildcards.condition)["sensor"],
            wildcards.category,
            CONFIG["seed"],
        ),


use rule train from paper as transfer_train with:
    input:
        code=sources("train_estimator"),
        splits="<results>/splits/{category}.csv",
        depth=lambda wildcards: condition_images(wildcards.trained, ".npy"),
        objects=lambda wildcards: condition_images(wildcards.trained, "_objects.json"),
        # Another estimator has seen the run's own condition.
        start=[],
    output:
        estimator="<results>/transfer/{trained}/estimators/{category}/el{elevation}/fold{fold}/estimator.safetensors",
    log:
        "<logs>/transfer/train/{trained}/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/transfer/train/{trained}/{category}/el{elevation}/fold{fold}.tsv"
    wildcard_constraints:
        fold=FOLDS,
    params:
        estimator=lambda wildcards: settings_of("training"),


use rule estimate from paper as transfer_estimate with:
    input:
        code=sources("estimate_views"),
        splits="<results>/splits/{category}.csv",
        depth=lambda wildcards: condition_images(wildcards.tested, ".npy"),
        objects=lambda wildcards: condition_images(wildcards.tested, "_objects.json"),
        estimator=lambda wildcards: condition_estimator(wildcards.trained),
        of_parts=[],
    output:
        calibration="<results>/transfer/{trained}/{tested}/estimates/{category}/el{elevation}/fold{fold}/calibration.csv",
        test="<results>/transfer/{trained}/{tested}/estimates/{category}/el{elevation}/fold{fold}/test.csv",
    log:
        "<logs>/transfer/estimate/{trained}/{tested}/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/transfer/estimate/{trained}/{tested}/{category}/el{elevation}/fold{fold}.tsv"
    wildcard_constraints:
        fold=FOLDS,


use rule lookup from paper as transfer_lookup with:
    input:
        code=sources("build_lookup"),
        splits="<results>/splits/{category}.csv",
        calibration="<results>/transfer/{trained}/{tested}/estimates/{category}/el{elevation}/fold{fold}/calibration.csv",
    output:
        "<results>/transfer/{trained}/{tested}/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
    log:
        "<logs>/transfer/lookup/{trained}/{tested}/{category}/el{elevation}/fold{fold}/{criterion}.log",
    benchmark:
        "<benchmarks>/transfer/lookup/{trained}/{tested}/{category}/el{elevation}/fold{fold}/{criterion}.tsv"


use rule evaluate from paper as transfer_evaluate with:
    input:
        code=sources("evaluate_methods"),
        splits="<results>/splits/{category}.csv",
        test="<results>/transfer/{trained}/{tested}/estimates/{category}/el{elevation}/fold{fold}/test.csv",
        lookups=expand(
            "<results>/transfer/{trained}/{tested}/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
            criterion=PLAN.lookup_criteria,
            allow_missing=True,
        ),
    output:
        expand(
            "<results>/transfer/{trained}/{tested}/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            method=METHODS,
            allow_missing=True,
        ),
    log:
        "<logs>/transfer/evaluate/{trained}/{tested}/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/transfer/evaluate/{trained}/{tested}/{category}/el{elevation}/fold{fold}.tsv"


rule transfer_table:
    input:
        code=sources("tabulate_transfer"),
        evaluations=paths(
            "<results>/transfer/{trained}/{tested}/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            [
                (trained, tested, *STUDIES.transfer_unit, fold, method)
                for trained, tested, fold, method in TRANSFER_KEYS
            ],
        ),
    output:
        csv="<results>/tables/transfer.csv",
        md="<results>/tables/transfer.md",
        tex="<results>/tables/transfer.tex",
    log:
        "<logs>/transfer/table.log",
    benchmark:
        "<benchmarks>/transfer/table.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        settings=PLAN.resampled,
        conditions=CONFIG["transfer"]["conditions"],
        unit=STUDIES.transfer_unit,
        evaluations=TRANSFER_KEYS,
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_transfer.py"


rule transfer:
    input:
        rules.transfer_table.output,

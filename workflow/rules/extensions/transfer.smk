# Trained on × tested on: the same objects and folds, under other sensors or framings.

import itertools

TRANSFER = CONFIG["transfer"]
CONDITIONS = list(TRANSFER["conditions"])
TRANSFER_UNIT = (TRANSFER["category"] or FOCUS, TRANSFER["elevation_deg"])
TRANSFER_FOLDS = TRANSFER["folds"] or list(FOLDS)
# What is made under one condition, and under a pair of them: trained on, tested on.
OF_CONDITION = LAYOUT.below("transfer", "{condition}")
OF_TRAINED = LAYOUT.below("transfer", "{trained}")
OF_PAIR = LAYOUT.below("transfer", "{trained}", "{tested}")
TRANSFER_KEYS = [
    (trained, tested, fold, method)
    for trained, tested in itertools.product(CONDITIONS, CONDITIONS)
    for fold in TRANSFER_FOLDS
    for method in METHODS
]


wildcard_constraints:
    condition="|".join(map(re.escape, CONDITIONS)),
    trained="|".join(map(re.escape, CONDITIONS)),
    tested="|".join(map(re.escape, CONDITIONS)),


use rule render as transfer_render with:
    input:
        lambda wildcards: sources(
            "render_depth", condition_settings(wildcards.condition)
        ),
        meshes=rules.meshes.output[0],
    output:
        depth=OF_CONDITION.depth(*UNIT),
        objects=OF_CONDITION.depth_objects(*UNIT),
    log:
        LAYOUT.log(f"transfer/render/{{condition}}/{unit_folder(*UNIT)}"),
    benchmark:
        LAYOUT.benchmark(f"transfer/render/{{condition}}/{unit_folder(*UNIT)}")
    params:
        renderer=CONFIG["renderer"],
        camera=lambda wildcards: condition_settings(wildcards.condition)["camera"],
        sensor=lambda wildcards: sensor_settings(
            condition_settings(wildcards.condition)["sensor"],
            wildcards.category,
            CONFIG["seed"],
        ),


use rule train as transfer_train with:
    input:
        sources("train_estimator"),
        splits=rules.splits.output[0],
        depth=lambda wildcards: layout_of(wildcards.trained).depth(*UNIT),
        objects=lambda wildcards: layout_of(wildcards.trained).depth_objects(*UNIT),
        # Another estimator has seen the run's own condition.
        start=[],
    output:
        estimator=OF_TRAINED.estimator(*FOLD),
    log:
        LAYOUT.log(f"transfer/train/{{trained}}/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"transfer/train/{{trained}}/{fold_folder(*FOLD)}")
    params:
        estimator=STAGE_SETTINGS["training"],
        seed=CONFIG["seed"],


use rule estimate as transfer_estimate with:
    input:
        sources("estimate_views"),
        splits=rules.splits.output[0],
        depth=lambda wildcards: layout_of(wildcards.tested).depth(*UNIT),
        objects=lambda wildcards: layout_of(wildcards.tested).depth_objects(*UNIT),
        estimator=lambda wildcards: trained_under(wildcards.trained).estimator(*FOLD),
        of_parts=lambda wildcards: (
            stop(
                "transfer calibrates with objects held out: needs calibration=holdout"
            )
            if CROSSFIT
            else []
        ),
    output:
        calibration=OF_PAIR.estimates(*FOLD, "calibration"),
        test=OF_PAIR.estimates(*FOLD, "test"),
    log:
        LAYOUT.log(f"transfer/estimate/{{trained}}/{{tested}}/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(
            f"transfer/estimate/{{trained}}/{{tested}}/{fold_folder(*FOLD)}"
        )


use rule lookup as transfer_lookup with:
    input:
        sources("build_lookup"),
        splits=rules.splits.output[0],
        calibration=rules.transfer_estimate.output.calibration,
    output:
        OF_PAIR.lookup(*FOLD, "{criterion}"),
    log:
        LAYOUT.log(
            f"transfer/lookup/{{trained}}/{{tested}}/{fold_folder(*FOLD)}/{{criterion}}"
        ),
    benchmark:
        LAYOUT.benchmark(
            f"transfer/lookup/{{trained}}/{{tested}}/{fold_folder(*FOLD)}/{{criterion}}"
        )


use rule evaluate_baselines as transfer_baselines with:
    input:
        sources("evaluate_baselines"),
        splits=rules.splits.output[0],
        test=rules.transfer_estimate.output.test,
    output:
        [OF_PAIR.evaluation(*FOLD, method) for method in BASELINE_METHODS],
    log:
        LAYOUT.log(
            f"transfer/evaluate_baselines/{{trained}}/{{tested}}/{fold_folder(*FOLD)}"
        ),
    benchmark:
        LAYOUT.benchmark(
            f"transfer/evaluate_baselines/{{trained}}/{{tested}}/{fold_folder(*FOLD)}"
        )


use rule evaluate_recommended as transfer_recommended with:
    input:
        sources("evaluate_recommended"),
        splits=rules.splits.output[0],
        test=rules.transfer_estimate.output.test,
        lookup=lambda wildcards: OF_PAIR.lookup(
            *FOLD, METHODS[wildcards.method]["policy"]
        ),
    output:
        OF_PAIR.evaluation(*FOLD, "{method}"),
    log:
        LAYOUT.log(
            f"transfer/evaluate_recommended/{{trained}}/{{tested}}/{fold_folder(*FOLD)}/{{method}}"
        ),
    benchmark:
        LAYOUT.benchmark(
            f"transfer/evaluate_recommended/{{trained}}/{{tested}}/{fold_folder(*FOLD)}/{{method}}"
        )


rule transfer_table:
    input:
        sources("tabulate_transfer"),
        evaluations=[
            LAYOUT.below("transfer", trained, tested).evaluation(
                *TRANSFER_UNIT, fold, method
            )
            for trained, tested, fold, method in TRANSFER_KEYS
        ],
    output:
        csv=LAYOUT.table("transfer", "csv"),
        md=LAYOUT.table("transfer", "md"),
        tex=LAYOUT.table("transfer", "tex"),
    log:
        LAYOUT.log("transfer/table"),
    benchmark:
        LAYOUT.benchmark("transfer/table")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        settings=RESAMPLED,
        conditions=TRANSFER["conditions"],
        unit=TRANSFER_UNIT,
        evaluations=TRANSFER_KEYS,
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_transfer.py"


rule transfer:
    input:
        rules.transfer_table.output,

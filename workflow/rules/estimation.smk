# One estimator for each fold of a unit, and its estimates for objects that it never saw.


# The network of all categories that a fold's estimators can start from, at lowest elevations.
rule pretrain:
    input:
        sources("pretrain_network"),
        splits=paths(LAYOUT.splits, [(category,) for category in CATEGORIES]),
        depth=paths(LAYOUT.depth, LOWEST_UNITS),
        objects=paths(LAYOUT.depth_objects, LOWEST_UNITS),
    output:
        LAYOUT.pretrained("{fold}"),
    log:
        LAYOUT.log("pretrain/fold{fold}"),
    benchmark:
        LAYOUT.benchmark("pretrain/fold{fold}")
    # Everything else waits for it.
    priority: 60
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2500 + 500 * len(CATEGORIES)),
        runtime=per_attempt(30),
    params:
        categories=CATEGORIES,
        estimator=STAGE_SETTINGS["pretraining"],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/pretrain_network.py"


use rule pretrain as pretrain_part with:
    output:
        LAYOUT.pretrained("{fold}", "{part}"),
    log:
        LAYOUT.log("pretrain_part/fold{fold}/{part}"),
    benchmark:
        LAYOUT.benchmark("pretrain_part/fold{fold}/{part}")


# It estimates, too, what its estimator has not seen: a job of its own would load torch once more.
rule train:
    input:
        sources("train_estimator"),
        splits=rules.splits.output[0],
        depth=rules.render.output.depth,
        objects=rules.render.output.objects,
        start=training_start,
    output:
        **estimates_of_training(),
        estimator=LAYOUT.estimator(*FOLD),
    log:
        LAYOUT.log(f"train/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"train/{fold_folder(*FOLD)}")
    # Longest jobs first: short ones fill the gaps at the end, when cores would stand idle.
    priority: 50
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2500),
        runtime=per_attempt(30),
    params:
        estimator=stage_of,
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/train_estimator.py"


# One estimator for each part: it trains on all other parts, and its part calibrates it.
use rule train as train_part with:
    output:
        estimator=LAYOUT.part_estimator(*FOLD, "{part}"),
    log:
        LAYOUT.log(f"train_part/{fold_folder(*FOLD)}/{{part}}"),
    benchmark:
        LAYOUT.benchmark(f"train_part/{fold_folder(*FOLD)}/{{part}}")


if EXTERNAL:

    rule estimate:
        input:
            sources("take_estimates"),
            splits=rules.splits.output[0],
            pairs=CONFIG["estimator"]["pairs"],
        output:
            **estimates_of_fold(),
        log:
            LAYOUT.log(f"estimate/{fold_folder(*FOLD)}"),
        benchmark:
            LAYOUT.benchmark(f"estimate/{fold_folder(*FOLD)}")
        conda:
            ENVIRONMENT
        resources:
            # Columns of probabilities take ten times as much in memory as in the file.
            mem_mb=per_attempt(
                1000 + 12 * Path(CONFIG["estimator"]["pairs"]).stat().st_size // 10**6
            ),
            runtime=per_attempt(10),
        script:
            f"{SCRIPTS}/take_estimates.py"

else:

    ruleorder: train > estimate

    # Where calibration is cross-fitted, several estimators answer for a fold.
    rule estimate:
        input:
            sources("estimate_views"),
            splits=rules.splits.output[0],
            depth=rules.render.output.depth,
            objects=rules.render.output.objects,
            estimator=rules.train.output.estimator,
            of_parts=[LAYOUT.part_estimator(*FOLD, part) for part in PARTS],
        output:
            **estimates_of_fold(),
        log:
            LAYOUT.log(f"estimate/{fold_folder(*FOLD)}"),
        benchmark:
            LAYOUT.benchmark(f"estimate/{fold_folder(*FOLD)}")
        conda:
            ENVIRONMENT
        resources:
            mem_mb=per_attempt(2000),
        params:
            device=CONFIG["estimator"]["device"],
            precision=CONFIG["estimator"]["precision"],
        script:
            f"{SCRIPTS}/estimate_views.py"


rule estimators:
    input:
        paths(LAYOUT.estimator, folds_of(UNITS)),


rule estimates:
    input:
        [
            LAYOUT.estimates(*fold, role)
            for fold in folds_of(UNITS)
            for role in ("calibration", "test")
        ],

# One estimator for each fold of a unit, and its estimates for objects that it never saw.


rule train:
    input:
        sources("train_estimator"),
        splits=rules.splits.output[0],
        depth=rules.render.output.depth,
        objects=rules.render.output.objects,
    output:
        LAYOUT.estimator(*FOLD),
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
        estimator=CONFIG["estimator"]
        | ({"epochs": CONFIG["crossfit_epochs"]} if CROSSFIT else {}),
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/train_estimator.py"


# One estimator for each part: it trains on all other parts, and its part calibrates it.
use rule train as train_part with:
    output:
        LAYOUT.part_estimator(*FOLD, "{part}"),
    log:
        LAYOUT.log(f"train_part/{fold_folder(*FOLD)}/{{part}}"),
    benchmark:
        LAYOUT.benchmark(f"train_part/{fold_folder(*FOLD)}/{{part}}")


rule estimate:
    input:
        sources("estimate_views"),
        splits=rules.splits.output[0],
        depth=rules.render.output.depth,
        objects=rules.render.output.objects,
        estimator=rules.train.output[0],
        of_parts=[LAYOUT.part_estimator(*FOLD, part) for part in PARTS],
    output:
        **{
            f"{role}_posteriors": LAYOUT.posteriors(*FOLD, role)
            for role in ("calibration", "test")
            if CONFIG["gives_distributions"]
        },
        calibration=LAYOUT.estimates(*FOLD, "calibration"),
        test=LAYOUT.estimates(*FOLD, "test"),
    log:
        LAYOUT.log(f"estimate/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"estimate/{fold_folder(*FOLD)}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(10),
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

# One estimator for each category, elevation and fold, and what it answers for objects it never saw.

FOLD = "{category}/el{elevation}/fold{fold}"


rule train:
    input:
        sources("train"),
        splits=rules.splits.output[0],
        depth=rules.render.output[0],
    output:
        f"{RESULTS}/estimators/{FOLD}/estimator.safetensors",
    log:
        log_path("train", f"/{FOLD}"),
    benchmark:
        benchmark_path("train", f"/{FOLD}")
    params:
        estimator=CONFIG["estimator"],
        seed=CONFIG["seed"],
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    script:
        script_path("train")


rule estimate:
    input:
        sources("estimate"),
        splits=rules.splits.output[0],
        depth=rules.render.output[0],
        estimator=rules.train.output[0],
    output:
        calibration=f"{RESULTS}/estimates/{FOLD}/calibration.csv",
        test=f"{RESULTS}/estimates/{FOLD}/test.csv",
    log:
        log_path("estimate", f"/{FOLD}"),
    benchmark:
        benchmark_path("estimate", f"/{FOLD}")
    params:
        device=CONFIG["estimator"]["device"],
        precision=CONFIG["estimator"]["precision"],
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    script:
        script_path("estimate")


rule estimators:
    input:
        per_fold("estimators", "estimator.safetensors"),


rule estimates:
    input:
        per_fold("estimates", ["calibration.csv", "test.csv"]),

# One estimator for each category, elevation and fold, and what it answers for objects it never saw.

TRAINING = CONFIG["estimator"] | (
    {"epochs": CONFIG["crossfit_epochs"]} if CROSSFIT else {}
)
POSTERIORS = {
    f"{role}_posteriors": f"{RESULTS}/estimates/{FOLD}/{role}_posteriors.npz"
    for role in ("calibration", "test")
    if has_posteriors(CONFIG)
}


rule train:
    input:
        sources("train"),
        splits=rules.splits.output[0],
        depth=rules.render.output[0],
    output:
        f"{RESULTS}/estimators/{FOLD}/estimator.safetensors",
    log:
        log_path(f"train/{FOLD}"),
    benchmark:
        benchmark_path(f"train/{FOLD}")
    # Longest jobs first: the short ones fill the gaps at the end, when cores would stand idle.
    priority: 50
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        estimator=TRAINING,
        seed=CONFIG["seed"],
    script:
        script_path("train")


# Each of all parts but one, to calibrate that one.
use rule train as train_part with:
    output:
        f"{RESULTS}/estimators/{FOLD}/without_part{{part}}.safetensors",
    log:
        log_path(f"train_part/{FOLD}/{{part}}"),
    benchmark:
        benchmark_path(f"train_part/{FOLD}/{{part}}")


rule estimate:
    input:
        sources("estimate"),
        splits=rules.splits.output[0],
        depth=rules.render.output[0],
        estimator=rules.train.output[0],
        of_parts=expand(rules.train_part.output[0], part=PARTS, allow_missing=True),
    output:
        **POSTERIORS,
        calibration=f"{RESULTS}/estimates/{FOLD}/calibration.csv",
        test=f"{RESULTS}/estimates/{FOLD}/test.csv",
    log:
        log_path(f"estimate/{FOLD}"),
    benchmark:
        benchmark_path(f"estimate/{FOLD}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        device=CONFIG["estimator"]["device"],
        precision=CONFIG["estimator"]["precision"],
    script:
        script_path("estimate")


rule estimators:
    input:
        per_fold("estimators", "estimator.safetensors"),


rule estimates:
    input:
        per_fold("estimates", ["calibration.csv", "test.csv"]),

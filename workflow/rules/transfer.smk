# Trained on × tested on: the same objects and folds, seen by other sensors or framed otherwise.


use rule render as transfer_render with:
    input:
        lambda wildcards: sources("render", condition_settings(wildcards.condition)),
        meshes=rules.meshes.output[0],
    output:
        f"{RESULTS}/transfer/depth/{{condition}}/{{category}}/el{{elevation}}.npy",
    log:
        log_path(f"transfer/render/{{condition}}/{{category}}/el{{elevation}}"),
    benchmark:
        benchmark_path(f"transfer/render/{{condition}}/{{category}}/el{{elevation}}")
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
        sources("train"),
        splits=rules.splits.output[0],
        depth=lambda wildcards: depth_of(wildcards.trained),
    output:
        f"{RESULTS}/transfer/estimators/{{trained}}/{FOLD}/estimator.safetensors",
    log:
        log_path(f"transfer/train/{{trained}}/{FOLD}"),
    benchmark:
        benchmark_path(f"transfer/train/{{trained}}/{FOLD}")


use rule estimate as transfer_estimate with:
    input:
        sources("estimate"),
        splits=rules.splits.output[0],
        depth=lambda wildcards: depth_of(wildcards.tested),
        estimator=lambda wildcards: of_condition(
            f"estimators/{FOLD}/estimator.safetensors", wildcards.trained
        ),
        of_parts=lambda wildcards: (
            stop(
                "transfer calibrates with objects held out: needs calibration=holdout"
            )
            if CROSSFIT
            else []
        ),
    output:
        calibration=f"{RESULTS}/transfer/estimates/{PAIR}/{FOLD}/calibration.csv",
        test=f"{RESULTS}/transfer/estimates/{PAIR}/{FOLD}/test.csv",
    log:
        log_path(f"transfer/estimate/{PAIR}/{FOLD}"),
    benchmark:
        benchmark_path(f"transfer/estimate/{PAIR}/{FOLD}")


use rule lookup as transfer_lookup with:
    input:
        sources("lookup"),
        splits=rules.splits.output[0],
        calibration=rules.transfer_estimate.output.calibration,
    output:
        f"{RESULTS}/transfer/lookup/{PAIR}/{FOLD}/{{criterion}}.npz",
    log:
        log_path(f"transfer/lookup/{PAIR}/{FOLD}/{{criterion}}"),
    benchmark:
        benchmark_path(f"transfer/lookup/{PAIR}/{FOLD}/{{criterion}}")


use rule evaluate_baselines as transfer_baselines with:
    input:
        sources("evaluate_baselines"),
        splits=rules.splits.output[0],
        test=rules.transfer_estimate.output.test,
    output:
        expand(
            f"{RESULTS}/transfer/evaluation/{PAIR}/{FOLD}/{{method}}.csv",
            method=BASELINE_METHODS,
            allow_missing=True,
        ),
    log:
        log_path(f"transfer/evaluate_baselines/{PAIR}/{FOLD}"),
    benchmark:
        benchmark_path(f"transfer/evaluate_baselines/{PAIR}/{FOLD}")


use rule evaluate_recommended as transfer_recommended with:
    input:
        sources("evaluate_recommended"),
        splits=rules.splits.output[0],
        test=rules.transfer_estimate.output.test,
        lookup=lambda wildcards: (
            f"{RESULTS}/transfer/lookup/{PAIR}/{FOLD}/"
            f"{CONFIG['methods'][wildcards.method]['rotation']}.npz"
        ),
    output:
        f"{RESULTS}/transfer/evaluation/{PAIR}/{FOLD}/{{method}}.csv",
    log:
        log_path(f"transfer/evaluate_recommended/{PAIR}/{FOLD}/{{method}}"),
    benchmark:
        benchmark_path(f"transfer/evaluate_recommended/{PAIR}/{FOLD}/{{method}}")


rule transfer_table:
    input:
        sources("transfer_table"),
        evaluations=expand(
            f"{RESULTS}/transfer/evaluation/{PAIR}/{{unit}}/fold{{fold}}/{{method}}.csv",
            trained=CONDITIONS,
            tested=CONDITIONS,
            unit=unit_names([TRANSFER_UNIT]),
            fold=TRANSFER_FOLDS,
            method=CONFIG["methods"],
        ),
    output:
        expand(f"{RESULTS}/tables/transfer.{{kind}}", kind=["csv", "md", "tex"]),
    log:
        log_path("transfer/table"),
    benchmark:
        benchmark_path("transfer/table")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        reading=RESAMPLED,
        conditions=TRANSFER["conditions"],
        unit=TRANSFER_UNIT,
        folds=TRANSFER_FOLDS,
    script:
        script_path("transfer_table")


rule transfer:
    input:
        rules.transfer_table.output,

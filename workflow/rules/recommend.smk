# Lookup tables from calibration pairs, and what each method makes of the test objects.


rule lookup:
    input:
        sources("lookup"),
        splits=rules.splits.output[0],
        calibration=rules.estimate.output.calibration,
    output:
        f"{RESULTS}/lookup/{FOLD}/{{criterion}}.npz",
    log:
        log_path(f"lookup/{FOLD}/{{criterion}}"),
    benchmark:
        benchmark_path(f"lookup/{FOLD}/{{criterion}}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=10,
    params:
        density=DECISION,
    script:
        script_path("lookup")


rule evaluate_baselines:
    input:
        sources("evaluate_baselines"),
        splits=rules.splits.output[0],
        test=rules.estimate.output.test,
    output:
        expand(
            f"{RESULTS}/evaluation/{FOLD}/{{method}}.csv",
            method=BASELINE_METHODS,
            allow_missing=True,
        ),
    log:
        log_path(f"evaluate_baselines/{FOLD}"),
    benchmark:
        benchmark_path(f"evaluate_baselines/{FOLD}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=10,
    params:
        methods={name: CONFIG["methods"][name] for name in BASELINE_METHODS},
        seed=CONFIG["seed"],
    script:
        script_path("evaluate_baselines")


rule evaluate_recommended:
    input:
        sources("evaluate_recommended"),
        splits=rules.splits.output[0],
        test=rules.estimate.output.test,
        lookup=recommending_lookup,
    output:
        f"{RESULTS}/evaluation/{FOLD}/{{method}}.csv",
    log:
        log_path(f"evaluate_recommended/{FOLD}/{{method}}"),
    benchmark:
        benchmark_path(f"evaluate_recommended/{FOLD}/{{method}}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=10,
    params:
        method=lambda wildcards: CONFIG["methods"][wildcards.method],
    script:
        script_path("evaluate_recommended")


# By what the estimator says of each image, where it does.
rule evaluate_beliefs:
    input:
        sources("evaluate_beliefs"),
        splits=rules.splits.output[0],
        calibration=rules.estimate.output.calibration,
        test=rules.estimate.output.test,
        calibration_posteriors=f"{RESULTS}/estimates/{FOLD}/calibration_posteriors.npz",
        test_posteriors=f"{RESULTS}/estimates/{FOLD}/test_posteriors.npz",
    output:
        belief=f"{RESULTS}/evaluation/{FOLD}/belief.csv",
        belief_opposite=f"{RESULTS}/evaluation/{FOLD}/belief_opposite.csv",
    log:
        log_path(f"evaluate_beliefs/{FOLD}"),
    benchmark:
        benchmark_path(f"evaluate_beliefs/{FOLD}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        script_path("evaluate_beliefs")


rule lookups:
    input:
        per_fold(
            "lookup",
            [f"{rotation}.npz" for rotation in LOOKUP_ROTATIONS],
        ),


rule evaluation:
    input:
        per_fold("evaluation", [f"{method}.csv" for method in evaluated(CONFIG)]),

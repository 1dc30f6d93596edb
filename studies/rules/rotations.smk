# Two views of an estimator in three dimensions: of a table of pairs, which needs no training, or of
# the study's own estimators.


rule evaluate_rotations:
    input:
        sources("evaluate_rotations"),
        pairs=lambda wildcards: rotation_file("pairs"),
        models_info=lambda wildcards: rotation_file("models_info"),
    output:
        "<results>/rotations/instances.csv",
    log:
        "<logs>/evaluate_rotations.log",
    benchmark:
        "<benchmarks>/evaluate_rotations.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(60),
    params:
        settings=CONFIG["rotations"],
    script:
        "../scripts/evaluate_rotations.py"


rule rotations:
    input:
        sources("tabulate_rotations"),
        figures=rotation_figures,
        models_info=lambda wildcards: rotation_file("models_info"),
    output:
        csv="<results>/tables/rotations.csv",
        md="<results>/tables/rotations.md",
    log:
        "<logs>/rotations.log",
    benchmark:
        "<benchmarks>/rotations.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        "../scripts/tabulate_rotations.py"

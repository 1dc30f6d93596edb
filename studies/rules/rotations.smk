# Up to four views of an estimator in three dimensions: of a table of pairs, which needs no
# training, or of the study's own estimators.


rule evaluate_rotations:
    input:
        code=sources("evaluate_rotations"),
        pairs=lambda wildcards: rotation_file("pairs"),
        models_info=lambda wildcards: rotation_file("models_info"),
    output:
        "<results>/rotations/walks.csv",
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
        settings={
            key: CONFIG["rotations"][key]
            for key in ("objects", "score_objects", "draws")
        },
        seed=CONFIG["seed"],
    script:
        "../scripts/evaluate_rotations.py"


rule rotations:
    input:
        code=sources("tabulate_rotations"),
        walks=rotation_walks,
        models_info=lambda wildcards: rotation_file("models_info"),
    output:
        csv="<results>/tables/rotations.csv",
        md="<results>/tables/rotations.md",
        reliability_csv="<results>/tables/rotation_reliability.csv",
        reliability_md="<results>/tables/rotation_reliability.md",
        png="<results>/figures/rotations.png",
        pdf="<results>/figures/rotations.pdf",
        svg="<results>/figures/rotations.svg",
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

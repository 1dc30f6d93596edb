# Linear estimators: the depth features of a unit's images, and the fits of its folds in one job.


rule extract:
    input:
        code=sources("extract_features"),
        network=os.path.relpath(SHIPPED),
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
    output:
        "<results>/features/{category}/el{elevation}.npy",
    log:
        "<logs>/extract/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/extract/{category}/el{elevation}.tsv"
    priority: 55
    conda:
        ENVIRONMENT
    params:
        mirrored=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category) is not None,
    script:
        "../scripts/extract_features.py"


rule fit:
    input:
        code=sources("fit_linear"),
        splits="<results>/splits/{category}.csv",
        features="<results>/features/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
    output:
        **fits_of_folds(),
    log:
        "<logs>/fit/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/fit/{category}/el{elevation}.tsv"
    priority: 50
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(30),
    params:
        folds=list(PLAN.folds),
        estimator=CONFIG["estimator"],
        mirror_plane_deg=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category),
    script:
        "../scripts/fit_linear.py"

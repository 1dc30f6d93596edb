# Linear estimators: the depth features of a unit's images, and a fit for each fold.


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
        **estimates_of_fold(),
        estimator="<results>/estimators/{category}/el{elevation}/fold{fold}/estimator.safetensors",
    log:
        "<logs>/fit/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/fit/{category}/el{elevation}/fold{fold}.tsv"
    priority: 50
    conda:
        ENVIRONMENT
    params:
        estimator=CONFIG["estimator"],
        mirror_plane_deg=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category),
    script:
        "../scripts/fit_linear.py"

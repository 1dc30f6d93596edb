# What a robot needs of a category, in one file. Its network sees all elevations, as a camera would:
# neither the paper's images nor its estimators, which know their elevation.


rule render_bundle:
    input:
        code=sources("render_bundle"),
        meshes="<results>/meshes/{category}.npz",
        splits="<results>/splits/{category}.csv",
    output:
        depth="<results>/bundles/depth/{category}/el{elevation}.npy",
        objects="<results>/bundles/depth/{category}/el{elevation}_objects.json",
    log:
        "<logs>/render_bundle/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/render_bundle/{category}/el{elevation}.tsv"
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(60),
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        randomisation=CONFIG["randomisation"],
        sensor=CONFIG["sensor"],
        fold=1,
        elevations=lambda wildcards: CONFIG["elevations_deg"][wildcards.category],
        calibration_turns=CONFIG["bundles"]["calibration_turns"],
        seed=CONFIG["seed"],
    script:
        "../scripts/render_bundle.py"


rule train_bundle:
    input:
        code=sources("train_bundle"),
        splits="<results>/splits/{category}.csv",
        depth=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}.npy"
        ),
        objects=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}_objects.json"
        ),
        start=BUNDLE_START,
    output:
        "<results>/bundles/estimators/{category}.safetensors",
    log:
        "<logs>/train_bundle/{category}.log",
    benchmark:
        "<benchmarks>/train_bundle/{category}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(9000),
        runtime=per_attempt(120),
    params:
        fold=1,
        estimator=lambda wildcards: settings_of(PLAN.bundle_stage),
        mirror_plane_deg=lambda wildcards: PLAN.mirror_plane_deg(wildcards.category),
        seed=CONFIG["seed"],
        replicate=0,
    script:
        "../scripts/train_bundle.py"


rule bundle:
    input:
        code=sources("make_bundle"),
        splits="<results>/splits/{category}.csv",
        depth=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}.npy"
        ),
        objects=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}_objects.json"
        ),
        test_depth=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}.npy"
        ),
        test_objects=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}_objects.json"
        ),
        estimator="<results>/bundles/estimators/{category}.safetensors",
        provenance="<results>/provenance.json",
    output:
        bundle="<results>/bundles/{category}.safetensors",
        evaluation="<results>/bundles/{category}.csv",
    log:
        "<logs>/bundle/{category}.log",
    benchmark:
        "<benchmarks>/bundle/{category}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(4000),
        runtime=per_attempt(30),
    params:
        fold=1,
        elevations=lambda wildcards: CONFIG["elevations_deg"][wildcards.category],
        camera=CONFIG["camera"],
        sensor=CONFIG["sensor"],
        affinity=CONFIG["affinity"],
        settings=PLAN.bundle_settings,
    script:
        "../scripts/make_bundle.py"


rule bundles:
    input:
        paths("<results>/bundles/{category}.safetensors", zip(CONFIG["categories"])),

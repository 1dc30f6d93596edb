# What a run was made with; its meshes, folds and depth images.


rule settings:
    input:
        code=sorted(
            {
                file
                for script in ROOT.glob("workflow/scripts/*.py")
                for file in sources(script.stem)
            }
        ),
    output:
        configuration="<results>/configuration.yaml",
        provenance="<results>/provenance.json",
    log:
        "<logs>/settings.log",
    benchmark:
        "<benchmarks>/settings.tsv"
    priority: 80
    conda:
        ENVIRONMENT
    params:
        configuration=CONFIG,
    script:
        "../scripts/record_settings.py"


rule meshes:
    input:
        code=mesh_sources,
    output:
        "<results>/meshes/{category}.npz",
    log:
        "<logs>/meshes/{category}.log",
    benchmark:
        "<benchmarks>/meshes/{category}.tsv"
    # First of all: a bad file stops the run before much is spent.
    priority: 1000
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1500),
        runtime=per_attempt(30),
    params:
        dataset=lambda wildcards: PLAN.dataset_of(wildcards.category),
        objects=lambda wildcards: PLAN.objects[wildcards.category],
        seed=CONFIG["seed"],
    script:
        "../scripts/prepare_meshes.py"


rule splits:
    input:
        code=sources("split_objects"),
        meshes=[] if PLAN.external else "<results>/meshes/{category}.npz",
    output:
        "<results>/splits/{category}.csv",
    log:
        "<logs>/splits/{category}.log",
    benchmark:
        "<benchmarks>/splits/{category}.tsv"
    priority: 90
    conda:
        ENVIRONMENT
    params:
        **({"crossfit_parts": len(PLAN.parts)} if PLAN.crossfit else {}),
        **(
            {"objects": lambda wildcards: PLAN.objects[wildcards.category]}
            if PLAN.external
            else {}
        ),
        n_folds=CONFIG["n_folds"],
        # What another program estimated needs no training.
        calibration_fraction=1.0 if PLAN.external else CONFIG["calibration_fraction"],
        seed=CONFIG["seed"],
    script:
        "../scripts/split_objects.py"


rule render:
    input:
        code=sources("render_depth"),
        meshes="<results>/meshes/{category}.npz",
    output:
        depth="<results>/depth/{category}/el{elevation}.npy",
        objects="<results>/depth/{category}/el{elevation}_objects.json",
    log:
        "<logs>/render/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/render/{category}/el{elevation}.tsv"
    priority: 60
    conda:
        ENVIRONMENT
    resources:
        runtime=per_attempt(30),
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        sensor=lambda wildcards: sensor_settings(
            CONFIG["sensor"], wildcards.category, CONFIG["seed"]
        ),
    script:
        "../scripts/render_depth.py"


rule renders:
    input:
        paths("<results>/depth/{category}/el{elevation}.npy", UNITS),

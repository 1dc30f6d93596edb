# What a run was made with; its meshes, folds and depth images.


rule settings:
    input:
        all_sources(),
    output:
        configuration=LAYOUT.configuration,
        provenance=LAYOUT.provenance,
    log:
        LAYOUT.log("settings"),
    benchmark:
        LAYOUT.benchmark("settings")
    priority: 80
    conda:
        ENVIRONMENT
    params:
        configuration=CONFIG,
    script:
        f"{SCRIPTS}/record_settings.py"


rule meshes:
    input:
        mesh_sources,
    output:
        LAYOUT.meshes("{category}"),
    log:
        LAYOUT.log("meshes/{category}"),
    benchmark:
        LAYOUT.benchmark("meshes/{category}")
    # First of all: a bad file stops the run before much is spent.
    priority: 1000
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1500),
        runtime=per_attempt(30),
    params:
        dataset=lambda wildcards: dataset_of(wildcards.category),
        objects=lambda wildcards: OBJECTS[wildcards.category],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/prepare_meshes.py"


rule splits:
    input:
        sources("split_objects"),
        meshes=[] if EXTERNAL else rules.meshes.output[0],
    output:
        LAYOUT.splits("{category}"),
    log:
        LAYOUT.log("splits/{category}"),
    benchmark:
        LAYOUT.benchmark("splits/{category}")
    priority: 90
    conda:
        ENVIRONMENT
    params:
        **({"crossfit_parts": len(PARTS)} if CROSSFIT else {}),
        **(
            {"objects": lambda wildcards: OBJECTS[wildcards.category]}
            if EXTERNAL
            else {}
        ),
        n_folds=CONFIG["n_folds"],
        # What another program estimated needs no training.
        calibration_fraction=1.0 if EXTERNAL else CONFIG["calibration_fraction"],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/split_objects.py"


rule render:
    input:
        sources("render_depth"),
        meshes=rules.meshes.output[0],
    output:
        depth=LAYOUT.depth(*UNIT),
        objects=LAYOUT.depth_objects(*UNIT),
    log:
        LAYOUT.log("render/{category}/el{elevation}"),
    benchmark:
        LAYOUT.benchmark("render/{category}/el{elevation}")
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
        f"{SCRIPTS}/render_depth.py"


rule renders:
    input:
        paths(LAYOUT.depth, UNITS),

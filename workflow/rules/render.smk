# Meshes, folds and depth images.


rule meshes:
    input:
        sources("meshes"),
    output:
        f"{RESULTS}/meshes/{{category}}.npz",
    log:
        log_path("meshes/{category}"),
    benchmark:
        benchmark_path("meshes/{category}")
    # Before all else: a bad file is to stop the run when little has been spent.
    priority: 1000
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        dataset=lambda wildcards: dataset_of(wildcards.category),
        objects=lambda wildcards: OBJECTS[wildcards.category],
        seed=CONFIG["seed"],
    script:
        script_path("meshes")


rule splits:
    input:
        sources("splits"),
        meshes=rules.meshes.output[0],
    output:
        f"{RESULTS}/splits/{{category}}.csv",
    log:
        log_path("splits/{category}"),
    benchmark:
        benchmark_path("splits/{category}")
    priority: 90
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        **({"crossfit_parts": len(PARTS)} if CROSSFIT else {}),
        n_folds=CONFIG["n_folds"],
        calibration_fraction=CONFIG["calibration_fraction"],
        seed=CONFIG["seed"],
    script:
        script_path("splits")


rule render:
    input:
        sources("render"),
        meshes=rules.meshes.output[0],
    output:
        f"{RESULTS}/depth/{{category}}/el{{elevation}}.npy",
    log:
        log_path("render/{category}/el{elevation}"),
    benchmark:
        benchmark_path("render/{category}/el{elevation}")
    priority: 60
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        sensor=lambda wildcards: sensor_settings(
            CONFIG["sensor"], wildcards.category, CONFIG["seed"]
        ),
    script:
        script_path("render")


rule renders:
    input:
        expand(f"{RESULTS}/depth/{{unit}}.npy", unit=unit_names(UNITS)),

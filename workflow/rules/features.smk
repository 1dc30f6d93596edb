# The depth features that the package ships: --config experiment=features, make features.


# Neighbouring views are alike: more objects are worth more than more views of each.
FEATURE_AZIMUTHS = 30
FEATURE_SETTINGS = (
    *("seed", "categories", "elevations_deg", "n_objects", "dataset"),
    *("camera", "sensor", "renderer", "mirror_plane_deg", "estimator"),
)


use rule render as render_for_features with:
    output:
        depth="<results>/feature_training/{category}/el{elevation}.npy",
        objects="<results>/feature_training/{category}/el{elevation}_objects.json",
    log:
        "<logs>/render_for_features/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/render_for_features/{category}/el{elevation}.tsv"
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        sensor=lambda wildcards: sensor_settings(
            CONFIG["sensor"], wildcards.category, CONFIG["seed"]
        ),
        n_azimuths=FEATURE_AZIMUTHS,


rule train_features:
    input:
        code=sources("train_features"),
        depth=paths("<results>/feature_training/{category}/el{elevation}.npy", UNITS),
        objects=paths(
            "<results>/feature_training/{category}/el{elevation}_objects.json", UNITS
        ),
        provenance=rules.settings.output.provenance,
    output:
        "<results>/feature_training/features.safetensors",
    log:
        "<logs>/train_features.log",
    benchmark:
        "<benchmarks>/train_features.tsv"
    conda:
        ENVIRONMENT
    threads: 2
    resources:
        mem_mb=per_attempt(10000),
        runtime=per_attempt(120),
    params:
        units=UNITS,
        estimator=PLAN.stage("training"),
        configuration={key: CONFIG[key] for key in FEATURE_SETTINGS},
        n_azimuths=FEATURE_AZIMUTHS,
    script:
        "../scripts/train_features.py"


rule features:
    input:
        rules.train_features.output,

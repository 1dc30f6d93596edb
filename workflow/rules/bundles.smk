# What a robot needs of a category, in one file. Its network sees all elevations, as a camera would.


BUNDLE_FOLD = 1
# Neither the paper's images nor its estimators: those know their elevation.
BUNDLE_UNIT = ("{category}", "{elevation}")


# What is left out of the randomisation, one after the other, to see what it brings.
INGREDIENTS = CONFIG["bundles"]["ingredients"]
WITHOUT = "{ingredient}"
FRAMES = CONFIG["bundles"]["frames"]


wildcard_constraints:
    ingredient="|".join(map(re.escape, INGREDIENTS)) or "none",


rule render_bundle:
    input:
        sources("render_bundle"),
        meshes=rules.meshes.output[0],
    output:
        depth=LAYOUT.bundle_depth(*BUNDLE_UNIT),
        objects=LAYOUT.bundle_objects(*BUNDLE_UNIT),
    log:
        LAYOUT.log("render_bundle/{category}/el{elevation}"),
    benchmark:
        LAYOUT.benchmark("render_bundle/{category}/el{elevation}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1000),
        runtime=per_attempt(60),
    params:
        renderer=CONFIG["renderer"],
        camera=CONFIG["camera"],
        randomisation=randomisation_of,
        sensor=CONFIG["sensor"],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/render_bundle.py"


rule train_bundle:
    input:
        sources("train_bundle"),
        splits=rules.splits.output[0],
        depth=elevations_of_bundle(LAYOUT.bundle_depth),
        objects=elevations_of_bundle(LAYOUT.bundle_objects),
    output:
        LAYOUT.bundle_estimator("{category}"),
    log:
        LAYOUT.log("train_bundle/{category}"),
    benchmark:
        LAYOUT.benchmark("train_bundle/{category}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(9000),
        runtime=per_attempt(120),
    params:
        fold=BUNDLE_FOLD,
        estimator=STAGE_SETTINGS["training"],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/train_bundle.py"


rule bundle:
    input:
        sources("make_bundle"),
        splits=rules.splits.output[0],
        depth=elevations_of_bundle(LAYOUT.bundle_depth),
        objects=elevations_of_bundle(LAYOUT.bundle_objects),
        # What is tested on is always as random as the configuration says.
        test_depth=elevations_of_bundle(LAYOUT.bundle_depth, of_ingredient=False),
        test_objects=elevations_of_bundle(LAYOUT.bundle_objects, of_ingredient=False),
        estimator=rules.train_bundle.output[0],
        provenance=LAYOUT.provenance,
    output:
        bundle=LAYOUT.bundle("{category}", "safetensors"),
        evaluation=LAYOUT.bundle("{category}", "csv"),
    log:
        LAYOUT.log("bundle/{category}"),
    benchmark:
        LAYOUT.benchmark("bundle/{category}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(4000),
        runtime=per_attempt(30),
    params:
        fold=BUNDLE_FOLD,
        elevations=lambda wildcards: CONFIG["elevations_deg"][wildcards.category],
        camera=CONFIG["camera"],
        sensor=CONFIG["sensor"],
        affinity=CONFIG["affinity"],
        settings=bundle_settings,
    script:
        f"{SCRIPTS}/make_bundle.py"


use rule render_bundle as render_without with:
    output:
        depth=LAYOUT.bundle_depth(*BUNDLE_UNIT, WITHOUT),
        objects=LAYOUT.bundle_objects(*BUNDLE_UNIT, WITHOUT),
    log:
        LAYOUT.log("render_without/{ingredient}/{category}/el{elevation}"),
    benchmark:
        LAYOUT.benchmark("render_without/{ingredient}/{category}/el{elevation}")


use rule train_bundle as train_without with:
    output:
        LAYOUT.bundle_estimator("{category}", WITHOUT),
    log:
        LAYOUT.log("train_without/{ingredient}/{category}"),
    benchmark:
        LAYOUT.benchmark("train_without/{ingredient}/{category}")


use rule bundle as bundle_without with:
    input:
        sources("make_bundle"),
        splits=rules.splits.output[0],
        depth=elevations_of_bundle(LAYOUT.bundle_depth),
        objects=elevations_of_bundle(LAYOUT.bundle_objects),
        test_depth=elevations_of_bundle(LAYOUT.bundle_depth, of_ingredient=False),
        test_objects=elevations_of_bundle(LAYOUT.bundle_objects, of_ingredient=False),
        estimator=rules.train_without.output[0],
        provenance=LAYOUT.provenance,
    output:
        bundle=LAYOUT.bundle("{category}", "safetensors", WITHOUT),
        evaluation=LAYOUT.bundle("{category}", "csv", WITHOUT),
    log:
        LAYOUT.log("bundle_without/{ingredient}/{category}"),
    benchmark:
        LAYOUT.benchmark("bundle_without/{ingredient}/{category}")


rule ingredients:
    input:
        sources("tabulate_ingredients"),
        frames=lambda wildcards: files_of_manifest(FRAMES) if FRAMES else [],
        bundles=[
            LAYOUT.bundle(category, "safetensors", without)
            for category in CATEGORIES
            for without in (None, *INGREDIENTS)
        ],
        evaluations=[
            LAYOUT.bundle(category, "csv", without)
            for category in CATEGORIES
            for without in (None, *INGREDIENTS)
        ],
    output:
        csv=LAYOUT.table("ingredients", "csv"),
        md=LAYOUT.table("ingredients", "md"),
    log:
        LAYOUT.log("ingredients"),
    benchmark:
        LAYOUT.benchmark("ingredients")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(4000),
        runtime=per_attempt(60),
    params:
        bundles=[
            (category, without)
            for category in CATEGORIES
            for without in ("", *INGREDIENTS)
        ],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_ingredients.py"


rule bundles:
    input:
        [LAYOUT.bundle(category, "safetensors") for category in CATEGORIES],

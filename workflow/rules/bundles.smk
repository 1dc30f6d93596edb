# What a robot needs of a category, in one file. Its network sees all elevations, as a camera would.

BUNDLE_FOLD = 1
# Neither the paper's images nor its estimators: those know their elevation.
BUNDLE_UNIT = ("{category}", "{elevation}")
# What is left out of the randomisation, one after the other, to see what it brings.
INGREDIENTS = CONFIG["bundles"]["ingredients"]
REPLICATES = CONFIG["bundles"]["replicates"]
FRAMES = CONFIG["bundles"]["frames"]
# By their folders: what each training is without, and its replicate.
VARIANTS = {
    bundle_variant(without, replicate): (without, replicate)
    for without in ("", *INGREDIENTS)
    for replicate in {0, *REPLICATES}
}
# Replicates learn from the same images.
RENDERED = [folder for folder, (_, replicate) in VARIANTS.items() if replicate == 0]
# What the ingredients' table compares.
COMPARED = [
    (category, without, replicate)
    for category in CATEGORIES
    for without in ("", *INGREDIENTS)
    for replicate in REPLICATES
]


# In brackets: where nothing is left out, the only name is empty.
wildcard_constraints:
    variant="(" + "|".join(map(re.escape, VARIANTS)) + ")",


rule render_bundle:
    input:
        sources("render_bundle"),
        meshes=rules.meshes.output[0],
    output:
        depth=LAYOUT.bundle_depth(*BUNDLE_UNIT, "{variant}"),
        objects=LAYOUT.bundle_objects(*BUNDLE_UNIT, "{variant}"),
    log:
        LAYOUT.log("render_bundle{variant}/{category}/el{elevation}"),
    benchmark:
        LAYOUT.benchmark("render_bundle{variant}/{category}/el{elevation}")
    wildcard_constraints:
        variant="(" + "|".join(map(re.escape, RENDERED)) + ")",
    conda:
        ENVIRONMENT
    resources:
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
        LAYOUT.bundle_estimator("{category}", "{variant}"),
    log:
        LAYOUT.log("train_bundle{variant}/{category}"),
    benchmark:
        LAYOUT.benchmark("train_bundle{variant}/{category}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(9000),
        runtime=per_attempt(120),
    params:
        fold=BUNDLE_FOLD,
        estimator=STAGE_SETTINGS["training"],
        seed=CONFIG["seed"],
        replicate=lambda wildcards: VARIANTS[wildcards.variant][1],
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
        bundle=LAYOUT.bundle("{category}", "safetensors", "{variant}"),
        evaluation=LAYOUT.bundle("{category}", "csv", "{variant}"),
    log:
        LAYOUT.log("bundle{variant}/{category}"),
    benchmark:
        LAYOUT.benchmark("bundle{variant}/{category}")
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


rule ingredients:
    input:
        sources("tabulate_ingredients"),
        frames=lambda wildcards: files_of_manifest(FRAMES) if FRAMES else [],
        bundles=[
            LAYOUT.bundle(category, "safetensors", bundle_variant(*variant))
            for category, *variant in COMPARED
        ],
        evaluations=[
            LAYOUT.bundle(category, "csv", bundle_variant(*variant))
            for category, *variant in COMPARED
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
        compared=COMPARED,
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_ingredients.py"


rule bundles:
    input:
        [LAYOUT.bundle(category, "safetensors") for category in CATEGORIES],

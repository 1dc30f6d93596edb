# What each part of the randomisation brings: bundles that are trained without it.


use rule render_bundle from paper as render_variant with:
    output:
        depth="<results>/bundles{variant}/depth/{category}/el{elevation}.npy",
        objects="<results>/bundles{variant}/depth/{category}/el{elevation}_objects.json",
    log:
        "<logs>/render_bundle{variant}/{category}/el{elevation}.log",
    benchmark:
        "<benchmarks>/render_bundle{variant}/{category}/el{elevation}.tsv"
    wildcard_constraints:
        variant="|".join(map(re.escape, STUDIES.rendered_variants)) or "none",
    params:
        randomisation=lambda wildcards: STUDIES.randomisation(wildcards.variant),


use rule train_bundle from paper as train_variant with:
    input:
        code=sources("train_bundle"),
        splits="<results>/splits/{category}.csv",
        depth=variant_images(".npy"),
        objects=variant_images("_objects.json"),
        start=BUNDLE_START,
    output:
        "<results>/bundles{variant}/estimators/{category}.safetensors",
    log:
        "<logs>/train_bundle{variant}/{category}.log",
    benchmark:
        "<benchmarks>/train_bundle{variant}/{category}.tsv"
    wildcard_constraints:
        variant="|".join(map(re.escape, STUDIES.variants)) or "none",
    params:
        replicate=lambda wildcards: STUDIES.variants[wildcards.variant][1],


use rule bundle from paper as bundle_variant with:
    input:
        code=sources("make_bundle"),
        splits="<results>/splits/{category}.csv",
        depth=variant_images(".npy"),
        objects=variant_images("_objects.json"),
        # What is tested on is always as random as the configuration says.
        test_depth=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}.npy"
        ),
        test_objects=lambda wildcards: bundle_elevations(
            wildcards, "<results>/bundles/depth/{category}/el{elevation}_objects.json"
        ),
        estimator="<results>/bundles{variant}/estimators/{category}.safetensors",
        provenance="<results>/provenance.json",
    output:
        bundle="<results>/bundles{variant}/{category}.safetensors",
        evaluation="<results>/bundles{variant}/{category}.csv",
    log:
        "<logs>/bundle{variant}/{category}.log",
    benchmark:
        "<benchmarks>/bundle{variant}/{category}.tsv"
    wildcard_constraints:
        variant="|".join(map(re.escape, STUDIES.variants)) or "none",
    params:
        settings=lambda wildcards: STUDIES.bundle_settings(wildcards.variant),


rule ingredients:
    input:
        code=sources("tabulate_ingredients"),
        frames=real_frames,
        bundles=variant_files(".safetensors"),
        evaluations=variant_files(".csv"),
    output:
        csv="<results>/tables/ingredients.csv",
        md="<results>/tables/ingredients.md",
    log:
        "<logs>/ingredients.log",
    benchmark:
        "<benchmarks>/ingredients.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(4000),
        runtime=per_attempt(60),
    params:
        compared=STUDIES.compared_variants,
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_ingredients.py"

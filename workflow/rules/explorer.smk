# The page to play with: every object and first view of a finished run. On request only.


rule explorer:
    input:
        sources("build_explorer"),
        evaluations=paths(
            rules.evaluate_recommended.output[0], PLAN.evaluations_of(UNITS)
        ),
        lookups=paths(rules.lookup.output[0], PLAN.lookups),
        depth=[] if PLAN.external else paths(rules.render.output.depth, UNITS),
        objects=[] if PLAN.external else paths(rules.render.output.objects, UNITS),
        posteriors=(
            paths(estimates_of_fold()["test_posteriors"], PLAN.folds_of(UNITS))
            if CONFIG["gives_distributions"]
            else []
        ),
    output:
        "<results>/explorer.html",
    log:
        "<logs>/explorer.log",
    benchmark:
        "<benchmarks>/explorer.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(20),
    params:
        name=CONFIG["name"],
        policies={name: method["policy"] for name, method in METHODS.items()},
        evaluations=PLAN.evaluations_of(UNITS),
        lookups=PLAN.lookups,
        units=UNITS,
        folds=PLAN.folds_of(UNITS),
        more_views=CONFIG["more_views"],
        caution=PLAN.caution,
    script:
        "../scripts/build_explorer.py"

# The page to play with: every object and first view of a finished run. On request only.


rule explorer:
    input:
        code=sources("build_explorer"),
        evaluations=paths(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            PLAN.evaluations_of(UNITS),
        ),
        lookups=paths(
            "<results>/lookup/{category}/el{elevation}/fold{fold}/{criterion}.npz",
            PLAN.lookups,
        ),
        depth=(
            []
            if PLAN.external
            else paths("<results>/depth/{category}/el{elevation}.npy", UNITS)
        ),
        objects=(
            []
            if PLAN.external
            else paths("<results>/depth/{category}/el{elevation}_objects.json", UNITS)
        ),
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

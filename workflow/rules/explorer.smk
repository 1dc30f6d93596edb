# The page to play with: every object and first view of a finished run. On request only.

EXPLORED_LOOKUPS = [
    (*fold, criterion) for fold in folds_of(UNITS) for criterion in LOOKUP_CRITERIA
]


rule explorer:
    input:
        sources("build_explorer"),
        evaluations=paths(LAYOUT.evaluation, evaluations_of(UNITS)),
        lookups=paths(LAYOUT.lookup, EXPLORED_LOOKUPS),
        depth=[] if EXTERNAL else paths(LAYOUT.depth, UNITS),
        objects=[] if EXTERNAL else paths(LAYOUT.depth_objects, UNITS),
        posteriors=(
            [LAYOUT.posteriors(*fold, "test") for fold in folds_of(UNITS)]
            if CONFIG["gives_distributions"]
            else []
        ),
    output:
        LAYOUT.explorer,
    log:
        LAYOUT.log("explorer"),
    benchmark:
        LAYOUT.benchmark("explorer")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(20),
    params:
        name=CONFIG["name"],
        policies={name: method["policy"] for name, method in METHODS.items()},
        evaluations=evaluations_of(UNITS),
        lookups=EXPLORED_LOOKUPS,
        units=UNITS,
        folds=folds_of(UNITS),
        more_views=CONFIG["more_views"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/build_explorer.py"

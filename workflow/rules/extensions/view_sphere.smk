# Rotation and elevation of the second view, chosen together. This needs a category at several
# elevations: the focus category, or else the first one.

SPHERE_CATEGORIES = [
    category
    for category in sorted(CATEGORIES, key=lambda category: category != FOCUS)
    if len(CONFIG["elevations_deg"][category]) > 1
][:1]


rule evaluate_view_sphere:
    input:
        sources("evaluate_view_sphere"),
        splits=rules.splits.output[0],
        calibration=at_every_elevation(
            lambda *fold: LAYOUT.estimates(*fold, "calibration")
        ),
        test=at_every_elevation(lambda *fold: LAYOUT.estimates(*fold, "test")),
        choices=at_every_elevation(lambda *fold: LAYOUT.extension(*fold, "choices")),
    output:
        LAYOUT.view_sphere("{category}", "{fold}"),
    log:
        LAYOUT.log("evaluate_view_sphere/{category}/fold{fold}"),
    benchmark:
        LAYOUT.benchmark("evaluate_view_sphere/{category}/fold{fold}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
        runtime=per_attempt(20),
    params:
        density=DECISION,
        more_views=CONFIG["more_views"],
        elevations=lambda wildcards: CONFIG["elevations_deg"][wildcards.category],
    script:
        f"{SCRIPTS}/evaluate_view_sphere.py"


rule view_sphere:
    input:
        sources("tabulate_view_sphere"),
        rows=rows_of_view_sphere,
    output:
        csv=LAYOUT.table("view_sphere", "csv"),
        md=LAYOUT.table("view_sphere", "md"),
        tex=LAYOUT.table("view_sphere", "tex"),
    log:
        LAYOUT.log("view_sphere"),
    benchmark:
        LAYOUT.benchmark("view_sphere")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(1000),
        runtime=per_attempt(10),
    params:
        folds=list(FOLDS),
        category=SPHERE_CATEGORIES[0] if SPHERE_CATEGORIES else "",
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_view_sphere.py"

# More than two views: error and travel against the number of views.


rule evaluate_more_views:
    input:
        sources("evaluate_more_views"),
        **estimates_of_fold(),
        splits=rules.splits.output[0],
        choices=rules.evaluate_extensions.output.choices,
    output:
        LAYOUT.extension(*FOLD, "more_views"),
    log:
        LAYOUT.log(f"evaluate_more_views/{fold_folder(*FOLD)}"),
    benchmark:
        LAYOUT.benchmark(f"evaluate_more_views/{fold_folder(*FOLD)}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        density=EXTENSION_DECISION,
        more_views=CONFIG["more_views"],
        seed=CONFIG["seed"],
    script:
        f"{SCRIPTS}/evaluate_more_views.py"


rule more_views:
    input:
        sources("tabulate_more_views"),
        rows=rows_of_more_views,
    output:
        csv=LAYOUT.table("more_views", "csv"),
        md=LAYOUT.table("more_views", "md"),
        tex=LAYOUT.table("more_views", "tex"),
        png=LAYOUT.figure("more_views", "png"),
        pdf=LAYOUT.figure("more_views", "pdf"),
        svg=LAYOUT.figure("more_views", "svg"),
    log:
        LAYOUT.log("more_views"),
    benchmark:
        LAYOUT.benchmark("more_views")
    conda:
        ENVIRONMENT
    params:
        folds=[(category, fold) for category, _, fold in folds_of(REFERENCE_UNITS)],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_more_views.py"

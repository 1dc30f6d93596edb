# More than two views: error and travel against the number of views.


rule evaluate_more_views:
    input:
        **estimates_of_fold(),
        code=sources("evaluate_more_views"),
        splits="<results>/splits/{category}.csv",
        choices="<results>/extensions/{category}/el{elevation}/fold{fold}/choices.csv",
    output:
        "<results>/extensions/{category}/el{elevation}/fold{fold}/more_views.csv",
    log:
        "<logs>/evaluate_more_views/{category}/el{elevation}/fold{fold}.log",
    benchmark:
        "<benchmarks>/evaluate_more_views/{category}/el{elevation}/fold{fold}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=per_attempt(2000),
    params:
        density=STUDIES.decision,
        more_views=CONFIG["more_views"],
        seed=CONFIG["seed"],
    script:
        "../scripts/evaluate_more_views.py"


rule more_views:
    input:
        code=sources("tabulate_more_views"),
        rows=rows_of_more_views,
    output:
        csv="<results>/tables/more_views.csv",
        md="<results>/tables/more_views.md",
        tex="<results>/tables/more_views.tex",
        png="<results>/figures/more_views.png",
        pdf="<results>/figures/more_views.pdf",
        svg="<results>/figures/more_views.svg",
    log:
        "<logs>/more_views.log",
    benchmark:
        "<benchmarks>/more_views.tsv"
    conda:
        ENVIRONMENT
    params:
        folds=[
            (category, fold)
            for category, _, fold in PLAN.folds_of(PLAN.reference_units)
        ],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_more_views.py"

# Error against travel, as the cost of a degree rises.

# Of all extensions those whose curves differ: one criterion with each fusion, and the paper's.
TRAVEL_CURVES = [
    *("either_way_average", "either_way_posterior"),
    *(
        name
        for name in (
            "ambiguity_posterior",
            "gain_posterior",
            "error_average",
            "error_posterior",
        )
        if name in CONFIG["extensions"]
    ),
]


rule travel:
    input:
        code=sources("tabulate_travel"),
        rows=paths(
            "<results>/extensions/{category}/el{elevation}/fold{fold}/travel.csv",
            PLAN.folds_of(PLAN.reference_units),
        ),
    output:
        csv="<results>/tables/travel.csv",
        png="<results>/figures/travel.png",
        pdf="<results>/figures/travel.pdf",
        svg="<results>/figures/travel.svg",
    log:
        "<logs>/travel.log",
    benchmark:
        "<benchmarks>/travel.tsv"
    conda:
        ENVIRONMENT
    params:
        folds=[
            (category, fold)
            for category, _, fold in PLAN.folds_of(PLAN.reference_units)
        ],
        methods=TRAVEL_CURVES,
    script:
        "../scripts/tabulate_travel.py"

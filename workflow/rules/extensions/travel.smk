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
        if name in EXTENSIONS
    ),
]


rule travel:
    input:
        sources("tabulate_travel"),
        rows=[LAYOUT.extension(*fold, "travel") for fold in folds_of(REFERENCE_UNITS)],
    output:
        csv=LAYOUT.table("travel", "csv"),
        png=LAYOUT.figure("travel", "png"),
        pdf=LAYOUT.figure("travel", "pdf"),
        svg=LAYOUT.figure("travel", "svg"),
    log:
        LAYOUT.log("travel"),
    benchmark:
        LAYOUT.benchmark("travel")
    conda:
        ENVIRONMENT
    params:
        folds=[(category, fold) for category, _, fold in folds_of(REFERENCE_UNITS)],
        methods=TRAVEL_CURVES,
    script:
        f"{SCRIPTS}/tabulate_travel.py"

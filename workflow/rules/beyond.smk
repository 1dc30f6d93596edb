# Beyond the paper: other criteria and fusion on the same estimates, and how all methods stand.


rule contend:
    input:
        sources("contend"),
        splits=rules.splits.output[0],
        calibration=rules.estimate.output.calibration,
        test=rules.estimate.output.test,
        paper=expand(
            f"{RESULTS}/evaluation/{FOLD}/{{method}}.csv",
            method=CONFIG["methods"],
            allow_missing=True,
        ),
    output:
        evaluations=expand(
            f"{RESULTS}/evaluation/{FOLD}/{{method}}.csv",
            method=CONFIG["contenders"],
            allow_missing=True,
        ),
        lookups=expand(
            f"{RESULTS}/lookup/{FOLD}/{{method}}.npz",
            method=[
                name
                for name, method in CONFIG["contenders"].items()
                if method["rotation"] in CRITERIA
            ],
            allow_missing=True,
        ),
        choices=f"{RESULTS}/contest/{FOLD}/choices.csv",
        objects=f"{RESULTS}/contest/{FOLD}/objects.csv",
        travel=f"{RESULTS}/contest/{FOLD}/travel.csv",
    log:
        log_path(f"contend/{FOLD}"),
    benchmark:
        benchmark_path(f"contend/{FOLD}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        contenders=CONFIG["contenders"],
        density=DECISION,
        seed=CONFIG["seed"],
    script:
        script_path("contend")


rule sequence:
    input:
        sources("sequence"),
        splits=rules.splits.output[0],
        calibration=rules.estimate.output.calibration,
        test=rules.estimate.output.test,
        choices=rules.contend.output.choices,
    output:
        f"{RESULTS}/contest/{FOLD}/sequence.csv",
    log:
        log_path(f"sequence/{FOLD}"),
    benchmark:
        benchmark_path(f"sequence/{FOLD}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        density=DECISION,
        sequence=CONFIG["sequence"],
        seed=CONFIG["seed"],
    script:
        script_path("sequence")


rule sphere_fold:
    input:
        sources("sphere"),
        splits=rules.splits.output[0],
        calibration=at_every_elevation(rules.estimate.output.calibration),
        test=at_every_elevation(rules.estimate.output.test),
        choices=at_every_elevation(rules.contend.output.choices),
    output:
        f"{RESULTS}/contest/{{category}}/sphere/fold{{fold}}.csv",
    log:
        log_path("sphere/{category}/fold{fold}"),
    benchmark:
        benchmark_path("sphere/{category}/fold{fold}")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        density=DECISION,
        sequence=CONFIG["sequence"],
        elevations=lambda wildcards: CONFIG["elevations_deg"][wildcards.category],
    script:
        script_path("sphere")


rule leaderboard:
    input:
        sources("leaderboard"),
        objects=lambda wildcards: sum(leaderboard_objects(wildcards).values(), []),
    output:
        expand(
            f"{RESULTS}/tables/{{name}}.{{kind}}",
            name=["leaderboard", "beyond"],
            kind=["csv", "md", "tex"],
        ),
    log:
        log_path("leaderboard"),
    benchmark:
        benchmark_path("leaderboard")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        objects=leaderboard_objects,
        contenders=CONFIG["contenders"],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        script_path("leaderboard")


SEQUENCES = files_by_fold(rules.sequence.output[0], REFERENCE_UNITS)
TRAVELS = files_by_fold(rules.contend.output.travel, REFERENCE_UNITS)
# The sphere needs a category at several elevations: the first such, the focus before others.
SPHERE_CATEGORIES = [
    category
    for category in sorted(CATEGORIES, key=lambda category: category != FOCUS)
    if len(CONFIG["elevations_deg"][category]) > 1
][:1]
SPHERES = files_by_fold(
    rules.sphere_fold.output[0], [(category, 0) for category in SPHERE_CATEGORIES]
)
# Of all contenders' curves those that differ: one criterion with each fusion, and the paper's.
TRAVEL_CURVES = [
    *("either_way_average", "either_way_posterior"),
    *(
        name
        for name in (
            "entropy_posterior",
            "gain_posterior",
            "error_average",
            "error_posterior",
        )
        if name in CONFIG["contenders"]
    ),
]


rule sequences:
    input:
        sources("sequences"),
        rows=all_files(SEQUENCES),
    output:
        table=expand(f"{RESULTS}/tables/sequences.{{kind}}", kind=["csv", "md", "tex"]),
        figure=expand(f"{RESULTS}/figures/sequences.{{kind}}", kind=["png", "pdf"]),
    log:
        log_path("sequences"),
    benchmark:
        benchmark_path("sequences")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        files=SEQUENCES,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        script_path("sequences")


rule travel:
    input:
        sources("travel"),
        rows=all_files(TRAVELS),
    output:
        table=f"{RESULTS}/tables/travel.csv",
        figure=expand(f"{RESULTS}/figures/travel.{{kind}}", kind=["png", "pdf"]),
    log:
        log_path("travel"),
    benchmark:
        benchmark_path("travel")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        files=TRAVELS,
        methods=TRAVEL_CURVES,
    script:
        script_path("travel")


rule sphere:
    input:
        sources("sphere_table"),
        rows=all_files(SPHERES),
    output:
        expand(f"{RESULTS}/tables/sphere.{{kind}}", kind=["csv", "md", "tex"]),
    log:
        log_path("sphere"),
    benchmark:
        benchmark_path("sphere")
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        files=SPHERES[SPHERE_CATEGORIES[0]] if SPHERE_CATEGORIES else {},
        category=SPHERE_CATEGORIES[0] if SPHERE_CATEGORIES else "",
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        script_path("sphere_table")


rule contest:
    input:
        per_fold("contest", ["choices.csv", "objects.csv", "travel.csv"]),


rule beyond:
    input:
        rules.leaderboard.output,
        rules.sequences.output,
        rules.travel.output,
        rules.sphere.output if SPHERE_CATEGORIES else [],

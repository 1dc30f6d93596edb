# All methods ranked, over this run or several.


rule leaderboard:
    input:
        sources("tabulate_leaderboard"),
        objects=leaderboard_files,
    output:
        csv=LAYOUT.table("leaderboard", "csv"),
        md=LAYOUT.table("leaderboard", "md"),
        tex=LAYOUT.table("leaderboard", "tex"),
    log:
        LAYOUT.log("leaderboard"),
    benchmark:
        LAYOUT.benchmark("leaderboard")
    conda:
        ENVIRONMENT
    params:
        folds=leaderboard_folds,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_leaderboard.py"


rule extension_gains:
    input:
        sources("tabulate_extension_gains"),
        objects=leaderboard_files("objects"),
        choices=leaderboard_files("choices"),
    output:
        csv=LAYOUT.table("extension_gains", "csv"),
        md=LAYOUT.table("extension_gains", "md"),
        tex=LAYOUT.table("extension_gains", "tex"),
    log:
        LAYOUT.log("extension_gains"),
    benchmark:
        LAYOUT.benchmark("extension_gains")
    conda:
        ENVIRONMENT
    params:
        folds=leaderboard_folds,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_extension_gains.py"

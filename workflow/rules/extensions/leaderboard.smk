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
    resources:
        mem_mb=per_attempt(1000),
        runtime=per_attempt(10),
    params:
        folds=leaderboard_folds,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=CAUTION,
    script:
        f"{SCRIPTS}/tabulate_leaderboard.py"

# All methods ranked, over this run or several.


rule leaderboard:
    input:
        code=sources("tabulate_leaderboard"),
        objects=leaderboard_files,
    output:
        csv="<results>/tables/leaderboard.csv",
        md="<results>/tables/leaderboard.md",
        tex="<results>/tables/leaderboard.tex",
    log:
        "<logs>/leaderboard.log",
    benchmark:
        "<benchmarks>/leaderboard.tsv"
    conda:
        ENVIRONMENT
    params:
        folds=one_line()(lambda wildcards: STUDIES.leaderboard_folds),
        methods=METHODS | CONFIG["extensions"],
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
        caution=PLAN.caution,
    script:
        "../scripts/tabulate_leaderboard.py"

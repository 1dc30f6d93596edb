# All methods ranked, over this run or several, and what the extensions gain.


def leaderboard_folds(wildcards):
    """Run, category, elevation and fold of everything that the leaderboard ranks."""
    keys = []
    for run in CONFIG["leaderboard_runs"] or [CONFIG["name"]]:
        settings = run_settings(run)
        keys += [
            (run, category, elevation, fold)
            for category in settings["categories"]
            for elevation in settings["elevations_deg"][category]
            for fold in range(1, settings["n_folds"] + 1)
        ]
    return keys


def leaderboard_files(name):
    """The extension files of that name, of every run."""

    def files(wildcards):
        return [
            run_file(
                run, Layout(f"results/{run}").extension(*fold, name), "leaderboard_runs"
            )
            for run, *fold in leaderboard_folds(wildcards)
        ]

    return files


rule leaderboard:
    input:
        sources("tabulate_leaderboard"),
        objects=leaderboard_files("objects"),
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
        mem_mb=1000,
        runtime=10,
    params:
        folds=leaderboard_folds,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        "../../scripts/tabulate_leaderboard.py"


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
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        folds=leaderboard_folds,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        "../../scripts/tabulate_extension_gains.py"

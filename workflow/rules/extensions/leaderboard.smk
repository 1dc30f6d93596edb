# All methods ranked, over this run or several, and what the extensions gain.


def leaderboard_keys(wildcards):
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
    """The extension files of that name, of every run; other runs' have to be there."""

    def files(wildcards):
        found = []
        for run, *fold in leaderboard_keys(wildcards):
            path = Layout(f"results/{run}").extension(*fold, name)
            if run != CONFIG["name"] and not Path(path).exists():
                stop(
                    f"leaderboard_runs: {path} does not exist: make it first, with the "
                    "target extension_evaluations and that run's configuration"
                )
            found.append(path)
        return found

    return files


rule leaderboard:
    input:
        sources("tabulate_leaderboard"),
        objects=leaderboard_files("objects"),
        choices=leaderboard_files("choices"),
    output:
        leaderboard=[LAYOUT.table("leaderboard", kind) for kind in ("csv", "md", "tex")],
        gains=[LAYOUT.table("extension_gains", kind) for kind in ("csv", "md", "tex")],
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
        keys=leaderboard_keys,
        methods=METHODS | EXTENSIONS,
        n_resamples=CONFIG["n_resamples"],
        seed=CONFIG["seed"],
    script:
        "../../scripts/tabulate_leaderboard.py"

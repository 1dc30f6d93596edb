# What the rules beyond the paper share: which files of which units and folds they need.

ABLATED = focus_unit(UNITS, READING_SETTINGS)


def at_every_elevation(pattern):
    return lambda wildcards: expand(
        pattern,
        category=wildcards.category,
        elevation=[f"{e:02d}" for e in CONFIG["elevations_deg"][wildcards.category]],
        fold=wildcards.fold,
    )


def contested_objects(run):
    """The objects' errors of a run, by file: this one's, or those of a finished one."""
    if run == CONFIG["name"]:
        return per_fold("contest", ["objects.csv"])
    found = sorted(
        map(str, Path("results", run).glob("contest/*/el*/fold*/objects.csv"))
    )
    if not found:
        stop(
            f"leaderboard_runs: results/{run}/contest does not exist: make it first, "
            "with the target contest and that run's configuration"
        )
    return found


def leaderboard_objects(wildcards):
    return {
        run: contested_objects(run)
        for run in CONFIG["leaderboard_runs"] or [CONFIG["name"]]
    }


def files_by_fold(pattern, units):
    """The file of each fold of each unit, by category and fold."""
    return {
        category: {
            fold: pattern.format(
                category=category, elevation=f"{elevation:02d}", fold=fold
            )
            for fold in FOLDS
        }
        for category, elevation in units
    }


def all_files(files):
    return [path for by_fold in files.values() for path in by_fold.values()]


def of_ablated(pattern):
    category, elevation = ABLATED
    return expand(pattern, category=category, elevation=f"{elevation:02d}", fold=FOLDS)

# What the studies make, and the functions of their rule files.

from studies.plan import (
    Studies,
    files_of_manifest,
    shuffle_folder,
    training_folder,
    variant_folder,
)
from studies.solids import SOLIDS

STUDIES = Studies(PLAN)
FOLD = "{category}/el{elevation}/fold{fold}"
# Of the study's own estimators of rotations.
OWN = "<results>/rotations/{category}"
OWN_FOLD = f"{OWN}/fold{{fold}}"


wildcard_constraints:
    shuffle=r"\d+",
    replicate=r"\d+",
    run="[^/]+",


@one_line()
def leaderboard_files(wildcards):
    """The objects' errors in every run."""
    pattern = f"results/{{run}}/extensions/{FOLD}/objects.csv"
    return files_of_runs(pattern, STUDIES.leaderboard_folds, "leaderboard_runs")


def files_of_runs(pattern, keys, option):
    """The files of some runs. Those of other runs are not made here; they have to be there."""
    found = paths(pattern, keys)
    for (run, *_), path in zip(keys, found):
        STUDIES.check_file(run, path, option)
    return found


@one_line()
def compared_keys(kind):
    """Run, category, elevation, fold and name of each file that the runs are compared by."""
    names_of = {
        "estimates": STUDIES.compared_roles,
        "evaluation": STUDIES.two_view_methods,
    }
    return STUDIES.compared(names_of[kind])


@one_line()
def compared_files(kind):
    """The files that the runs are compared by."""
    pattern = f"results/{{run}}/{kind}/{FOLD}/{{name}}.csv"
    return files_of_runs(pattern, compared_keys(kind), "compared_runs")


@one_line()
def rows_of_more_views(wildcards):
    STUDIES.check_posterior("random", "opposite")
    return paths(
        f"<results>/extensions/{FOLD}/more_views.csv",
        PLAN.folds_of(PLAN.reference_units),
    )


@one_line()
def condition_of(name):
    return STUDIES.condition(name)


@one_line()
def condition_images(name, kind):
    """The depth images of a condition (npy), or the objects in them (_objects.json)."""
    folder = f"<results>{STUDIES.condition_folder(name)}/depth"
    return f"{folder}/{{category}}/el{{elevation}}{kind}"


@one_line()
def condition_estimator(name):
    """The estimator that was trained under a condition."""
    folder = f"<results>{STUDIES.estimator_folder(name)}/estimators"
    return f"{folder}/{FOLD}/estimator.safetensors"


def shuffled_splits(wildcards):
    return f"<results>{shuffle_folder(wildcards.shuffle)}/splits/{{category}}.csv"


def all_shuffled_splits(wildcards):
    return paths(shuffled_splits(wildcards), zip(CONFIG["categories"]))


def replicate_start(wildcards):
    folder = training_folder(wildcards.shuffle, wildcards.replicate)
    return training_start(wildcards, f"<results>{folder}")


def held_out_files(suffix):
    """The files of everything that is kept of a training."""

    def found(wildcards):
        folder = training_folder(wildcards.shuffle, wildcards.replicate)
        pattern = f"<results>{folder}/estimates/{FOLD}/{{role}}{suffix}"
        return paths(pattern, STUDIES.held_out)

    return found


@one_line()
def kept_file(wildcards):
    """The file with the estimates of one training."""
    kept = "<results>/confirmation/kept/shuffle{shuffle}_replicate{replicate}.npz"
    return STUDIES.kept_runs[wildcards.run].path or kept


def factorial_files(name):
    """The files of one kind of every training, category and elevation."""
    pattern = f"<results>/confirmation/{name}/{{run}}/shuffle{{shuffle}}_replicate{{replicate}}"

    @one_line()
    def found(wildcards):
        runs = STUDIES.kept_runs.items()
        keys = [(run, *key) for run, kept in runs for key in kept.keys]
        return paths(f"{pattern}/{{category}}/el{{elevation}}.csv", keys)

    return found


def variant_images(kind):
    """The images of a variant at every elevation: its replicates learn from the same ones."""

    def found(wildcards):
        without, _ = STUDIES.variants[wildcards.variant]
        folder = f"<results>/bundles{variant_folder(without)}/depth"
        return bundle_elevations(
            wildcards, f"{folder}/{{category}}/el{{elevation}}{kind}"
        )

    return found


def variant_files(suffix):
    """The file of every bundle in the table."""
    return [
        f"<results>/bundles{variant_folder(*variant)}/{category}{suffix}"
        for category, *variant in STUDIES.compared_variants
    ]


@one_line()
def real_frames(wildcards):
    """The manifest of real frames and the files that it names, where there is one."""
    manifest = CONFIG["bundles"]["frames"]
    return files_of_manifest(manifest) if manifest else []


def shape_file(kind):
    """A category's file is the run's own; a solid's lies with its images."""

    def found(wildcards):
        if wildcards.category in SOLIDS:
            return f"<results>/rotations/{wildcards.category}/{kind}"
        folder, suffix = kind.split(".")
        return f"<results>/{folder}/{wildcards.category}.{suffix}"

    return found


@one_line()
def rotation_file(key):
    """A given file of the study `rotations`; without a table of pairs it needs none."""
    return STUDIES.rotation_files[key] if CONFIG["rotations"]["pairs"] else []


@one_line()
def rotation_walks(wildcards):
    """The walks of every instance: of the table that is given, or of every judged fold."""
    if CONFIG["rotations"]["pairs"]:
        return ["<results>/rotations/walks.csv"]
    return paths(f"{OWN_FOLD}/walks.csv", STUDIES.judged_folds)


@one_line()
def rotation_pairs(wildcards):
    """The pairs of every fold of each category, and of each solid."""
    return paths(f"{OWN_FOLD}/pairs.csv", STUDIES.shape_folds)

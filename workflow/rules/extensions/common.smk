# The functions of the extensions' rule files.

import collections
import functools

from nbv.experiment.config import load_condition, read_configuration
from studies.kept_estimates import kept_settings

TRAININGS = [
    (shuffle, replicate)
    for shuffle, replicates in enumerate(CONFIG["confirmation"]["replicates"])
    for replicate in replicates
]


@functools.cache
def run_settings(run):
    """The configuration of a finished run."""
    if run == CONFIG["name"]:
        return CONFIG
    try:
        return read_configuration(
            Path("results") / run,
            ("categories", "elevations_deg", "methods", "extensions"),
        )
    except UserError as error:
        stop(error)


def run_file(run, path, key):
    """A file of a run, named at that configuration key; only this run's are made here."""
    if run != CONFIG["name"] and not Path(path).exists():
        stop(f"{key}: {path} does not exist; finish the run {run} first")
    return path


# The runs that the leaderboard ranks.


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


def leaderboard_files(wildcards):
    """The objects' errors in every run."""
    return [
        run_file(
            run,
            Layout(f"results/{run}").extension(*fold, "objects"),
            "leaderboard_runs",
        )
        for run, *fold in leaderboard_folds(wildcards)
    ]


# Conditions of transfer, and the files made under them.


@functools.cache
def condition_settings(name):
    try:
        settings = load_condition(
            BASE / "config", OVERRIDES, CONFIG, TRANSFER["conditions"][name]
        )
        check_sensor(settings["sensor"], [TRANSFER_UNIT[0]])
    except UserError as error:
        stop(error)
    return settings


def layout_of(name):
    """The run's own files where it was made under that very condition."""
    settings = condition_settings(name)
    is_run = TRANSFER_UNIT in UNITS and all(
        settings[key] == CONFIG[key] for key in ("camera", "sensor")
    )
    return LAYOUT if is_run else LAYOUT.below("transfer", name)


def trained_under(name):
    """The run's own estimators only where they too were trained from random weights."""
    start = start_of_unit(*TRANSFER_UNIT)
    return layout_of(name) if start is None else LAYOUT.below("transfer", name)


def need_posterior(*policies):
    """End with one line where no extension with the fusion posterior has one of the policies."""
    methods = EXTENSIONS.values()
    known = {one["policy"] for one in methods if one["fusion"] == "posterior"}
    if absent := [policy for policy in policies if policy not in known]:
        stop(
            f"extensions: this target needs {{policy: {absent[0]}, fusion: posterior}}"
        )


def rows_of_more_views(wildcards):
    need_posterior("random", "opposite")
    return [LAYOUT.extension(*fold, "more_views") for fold in folds_of(REFERENCE_UNITS)]


# The runs that this one is compared with.


def compared_runs():
    """This run's name, then those that it is compared with."""
    return list(dict.fromkeys([CONFIG["name"], *CONFIG["compared_runs"]]))


def two_view_methods(run):
    """The paper's methods of two views, and those that multiply an estimator's distributions."""
    settings = run_settings(run)
    return [
        *(name for name, one in settings["methods"].items() if one["policy"] != "none"),
        *(
            name
            for name, one in settings["extensions"].items()
            if one.get("fusion") == "product"
        ),
    ]


def compared_roles(run):
    """Calibration objects are the same ones only where all runs calibrate alike."""
    ways = {run_settings(one).get("calibration", "holdout") for one in compared_runs()}
    return ESTIMATED_ROLES if len(ways) == 1 else ["test"]


def compared_keys(names_of):
    """Run, category, elevation, fold, and one of the names that a run has, of every file."""
    return [
        (run, *fold, name)
        for run in compared_runs()
        for fold in folds_of(UNITS)
        for name in names_of(run)
    ]


def compared(path, names_of):
    """The files of all runs. Those of other runs are not made here; they have to be there."""

    def files(wildcards):
        return [
            run_file(run, path(Layout(f"results/{run}"), *place), "compared_runs")
            for run, *place in compared_keys(names_of)
        ]

    return files


# Trainings beyond the run's own.


def replicate_layout(wildcards):
    return LAYOUT.replicate(wildcards.shuffle, wildcards.replicate)


def shuffled_splits(wildcards):
    return LAYOUT.shuffle(wildcards.shuffle).splits(wildcards.category)


def replicate_start(wildcards):
    return training_start(wildcards, replicate_layout(wildcards))


def held_out_keys():
    """Category, elevation, fold and role of what is kept of a training."""
    return [
        (*fold, role) for fold in folds_of(LOWEST_UNITS) for role in ESTIMATED_ROLES
    ]


def held_out_files(path):
    return lambda wildcards: [
        path(replicate_layout(wildcards), *key) for key in held_out_keys()
    ]


def dataset_name(settings):
    return settings["confirmation"]["dataset"] or settings["name"]


# The file that a run's estimates were kept in (None: this run's), what it holds (shuffle, replicate,
# category and elevation), and its data set.
KeptRun = collections.namedtuple("KeptRun", "path keys dataset")


@functools.cache
def kept_runs():
    """What the statistics are made of, by run."""
    if not CONFIG["confirmation"]["kept"]:
        keys = [
            (shuffle, replicate, *unit)
            for shuffle, replicate in TRAININGS
            for unit in LOWEST_UNITS
        ]
        own = KeptRun(None, keys, dataset_name(CONFIG))
        return {CONFIG["name"]: own}
    found = {}
    for path in CONFIG["confirmation"]["kept"]:
        try:
            settings, keys = kept_settings(path)
        except UserError as error:
            stop(f"confirmation.kept: {error}")
        run = settings["name"]
        if run in found:
            stop(
                f"confirmation.kept: {path} is of the run {run}, as {found[run].path} is"
            )
        keys = list(dict.fromkeys(key[:4] for key in keys))
        dataset = dataset_name(settings)
        for other in found.values():
            if other.dataset == dataset and {key[2] for key in keys} & {
                key[2] for key in other.keys
            }:
                stop(
                    f"confirmation.kept: {path} and {other.path} have the same categories of "
                    f"the data set {dataset}"
                )
        found[run] = KeptRun(path, keys, dataset)
    return found


def kept_file(wildcards):
    path = kept_runs()[wildcards.run].path
    return path or LAYOUT.kept_estimates(wildcards.shuffle, wildcards.replicate)


def factorial_files(name):
    return lambda wildcards: [
        LAYOUT.factorial(name, run, *key)
        for run, kept in kept_runs().items()
        for key in kept.keys
    ]


def statistics_places():
    """By kind of file, what each one is of."""
    of_training = [
        {"dataset": run.dataset} | dict(zip(("shuffle", "replicate", "category"), key))
        for run in kept_runs().values()
        for key in run.keys
    ]
    return dict.fromkeys(OF_FACTORIAL, of_training)

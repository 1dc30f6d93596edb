# The configuration, and all functions of the rule files.

import functools
import re
import sys
import time
from pathlib import Path

try:
    import nbv
except ModuleNotFoundError:
    sys.exit(
        "nbv: error: the package is not installed here: run make, or pip install --editable ."
    )

from nbv import provenance
from nbv.config import (
    load_condition,
    load_config,
    read_configuration,
    snakemake_overrides,
)
from nbv.config.memory import available_bytes, check_memory
from nbv.errors import UserError
from nbv.estimation.warm_start import PRETRAINED, STAGES, stage_settings, start_of
from nbv.experiments.kept_estimates import kept_settings
from nbv.experiments.results import ESTIMATED_ROLES
from nbv.jobs import killed_jobs
from nbv.layout import Layout, fold_folder, unit_folder
from nbv.meshes.sources import SOURCES, open_source, select_objects
from nbv.meshes.store import stored_ids
from nbv.processes import hold_lock
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.method_selection import check_methods
from nbv.recommendation.policies import needs_lookup
from nbv.rendering import RENDERERS
from nbv.rendering.noise import SENSORS, check_sensor, sensor_settings

BASE = Path(workflow.basedir)
STARTED = time.time()
# Held until this process ends.
RUN_LOCK = hold_lock(Path(".snakemake"))


def stop(message):
    """End with one line: nothing has been started yet."""
    sys.exit(f"nbv: error: {message}")


def tell(message):
    """Print a line, but not once more in each job that parses the workflow again."""
    if workflow.is_main_process:
        print(f"nbv: {message}", file=sys.stderr, flush=True)


if RUN_LOCK.removed:
    tell("the run before was killed; its lock is removed")
if RUN_LOCK.others:
    tell(
        "another run is working in this folder; one cannot make the files of the other"
    )


def selected_objects(category):
    """The objects of a category; those of the last run where the data set is gone."""
    root = CONFIG["dataset"]["root"]
    prepared = Path(LAYOUT.meshes(category))
    if root and not Path(root).expanduser().exists() and prepared.exists():
        return stored_ids(prepared)
    source = open_source(CONFIG["dataset"], CONFIG["seed"])
    return select_objects(source, category, CONFIG["n_objects"])


def dataset_of(category):
    """The data set's settings that concern one category; OBJECTS lists who is left out."""
    settings = {
        key: value
        for key, value in CONFIG["dataset"].items()
        if key not in ("exclude", "exclude_file")
    }
    for key in ("categories", "turn_deg"):
        settings[key] = {k: v for k, v in settings[key].items() if k == category}
    return settings | {"exclude": [], "exclude_file": None}


try:
    OVERRIDES = snakemake_overrides(config)
    CONFIG = load_config(BASE / "config", OVERRIDES)
    LAYOUT = Layout(f"results/{CONFIG['name']}")
    CATEGORIES = CONFIG["categories"]
    METHODS, EXTENSIONS = CONFIG["methods"], CONFIG["extensions"]
    check_methods(METHODS, EXTENSIONS, CONFIG["gives_distributions"])
    check_sensor(CONFIG["sensor"], CATEGORIES)
    # Jobs run here unless a number of jobs elsewhere was given, or this is such a job.
    MEMORY = available_bytes(
        is_local=workflow.is_main_process and workflow.resource_settings.nodes is None
    )
    check_memory(CONFIG, CONFIG["n_objects"] or 0, MEMORY)
    OBJECTS = {category: selected_objects(category) for category in CATEGORIES}
    check_memory(CONFIG, max(map(len, OBJECTS.values())), MEMORY)
except UserError as error:
    stop(error)
except OSError as error:
    stop(f"dataset.root: {error.filename} cannot be read: {error.strerror}")

# What decides on a rotation: the conditionals, and the cost of travel.
DECISION = CONFIG["density"] | CONFIG["recommendation"]
EXTENSION_DECISION = DECISION | {"affinity": CONFIG["affinity"]}
LOOKUP_METHODS = [name for name in METHODS if needs_lookup(METHODS[name]["policy"])]
BASELINE_METHODS = [name for name in METHODS if name not in LOOKUP_METHODS]
LOOKUP_CRITERIA = sorted({METHODS[name]["policy"] for name in LOOKUP_METHODS})
FOLDS = range(1, CONFIG["n_folds"] + 1)
# Parts of a fold's training objects, where calibration is cross-fitted.
CROSSFIT = CONFIG["calibration"] == "crossfit"
PARTS = range(1, CONFIG["crossfit_parts"] + 1) if CROSSFIT else []
# Cross-fitting trains each of its estimators in fewer epochs.
STAGE_SETTINGS = {
    stage: stage_settings(
        CONFIG["estimator"], stage, CONFIG["crossfit_epochs"] if CROSSFIT else None
    )
    for stage in STAGES
}
# A unit is a category at an elevation. Each fold of a unit has an estimator of its own.
UNITS = [
    (category, elevation)
    for category in CATEGORIES
    for elevation in CONFIG["elevations_deg"][category]
]
PRETRAINS = CONFIG["estimator"]["warm_start"] in ("categories", "both")
LOWEST_UNITS = [
    (category, min(CONFIG["elevations_deg"][category])) for category in CATEGORIES
]
REPLICATES = [
    (shuffle, replicate)
    for shuffle, replicates in enumerate(CONFIG["confirmation"]["replicates"])
    for replicate in replicates
]
# The wildcards of a unit and of a fold, as the paths of `nbv.layout` take them.
UNIT = ("{category}", "{elevation}")
FOLD = (*UNIT, "{fold}")
# Used with --software-deployment-method conda; otherwise jobs run where snakemake does.
ENVIRONMENT = str(BASE / "workflow/environment.yaml")
# A whole path, because rules in two folders use the same scripts.
SCRIPTS = BASE / "workflow/scripts"


wildcard_constraints:
    category="|".join(map(re.escape, CATEGORIES)),
    elevation=r"\d\d",
    fold="|".join(map(str, FOLDS)),
    part="|".join(map(str, PARTS)) or "none",
    method="|".join(map(re.escape, LOOKUP_METHODS)) or "none",
    criterion="|".join(LOOKUP_CRITERIA) or "none",


def sources(script, settings=CONFIG):
    """The modules that a script depends on, as inputs: an edit reruns what uses them."""
    sensor = settings["sensor"]["name"]
    chosen = {
        "prepare_meshes": [SOURCES[settings["dataset"]["source"]]],
        "render_depth": [
            RENDERERS[settings["renderer"]["name"]],
            *([SENSORS[sensor]] if sensor in SENSORS else []),
        ],
    }
    path = SCRIPTS / f"{script}.py"
    files = provenance.source_files(path, chosen.get(script, []))
    here = Path.cwd()
    return [
        str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
        for file in files
    ]


def all_sources():
    """The modules that the results as a whole depend on."""
    scripts = SCRIPTS.glob("*.py")
    return sorted({file for script in scripts for file in sources(script.stem)})


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


def folds_of(units):
    """Category, elevation and fold of every fold of some units."""
    return [(*unit, fold) for unit in units for fold in FOLDS]


def evaluations_of(units):
    """Category, elevation, fold and method of every evaluation in the paper's tables."""
    return [
        (*unit, fold, method) for unit in units for method in METHODS for fold in FOLDS
    ]


def paths(path, keys):
    """The path of each key: an input list that a script pairs with the keys."""
    return [path(*key) for key in keys]


def posteriors_of_fold(layout=LAYOUT):
    """The files of images' distributions by name, where the estimator gives them."""
    if not CONFIG["gives_distributions"]:
        return {}
    return {
        f"{role}_posteriors": layout.posteriors(*FOLD, role) for role in ESTIMATED_ROLES
    }


# What a training starts from.


def start_of_unit(category, elevation):
    elevations = CONFIG["elevations_deg"][category]
    return start_of(CONFIG["estimator"]["warm_start"], elevations, elevation)


def training_start(wildcards, layout=LAYOUT):
    """The estimators that a training starts from: one, or none where the weights are random."""
    start = start_of_unit(wildcards.category, int(wildcards.elevation))
    fold, part = wildcards.fold, wildcards.get("part")
    if start is None:
        return []
    if start == PRETRAINED:
        return [layout.pretrained(fold, part)]
    place = (wildcards.category, start, fold)
    if part is None:
        return [layout.estimator(*place)]
    return [layout.part_estimator(*place, part)]


def stage_of(wildcards):
    """The settings of a training."""
    stage = "fine_tuning" if training_start(wildcards) else "training"
    return STAGE_SETTINGS[stage]


# What tables and figures are about, and the files that they need.


def units_of(name):
    if name in OF_ELEVATIONS:
        return [unit for unit in UNITS if unit[0] == FOCUS]
    return [FOCUS_UNIT] if name in OF_FOCUS else REFERENCE_UNITS


def settings_of(settings, name):
    """The report settings that a table or figure depends on."""
    of_focus = name in OF_ELEVATIONS | OF_FOCUS
    return settings | ({"focus_category": FOCUS} if of_focus else {})


def figure_inputs(wildcards):
    units, needs = units_of(wildcards.figure), FIGURES[wildcards.figure].needs
    found = {"evaluations": paths(LAYOUT.evaluation, evaluations_of(units))}
    if "depth" in needs:
        found["depth"] = paths(LAYOUT.depth, units)
    if "objects" in needs:
        found["objects"] = paths(LAYOUT.depth_objects, units)
    if "lookups" in needs:
        found["lookups"] = [
            LAYOUT.lookup(*fold, PROPOSED_LOOKUP) for fold in folds_of(units)
        ]
    return found


def counted_jobs():
    """Rule and name of every job that the running time counts."""
    by_rule = {
        "meshes": CATEGORIES,
        "splits": CATEGORIES,
        "render": [unit_folder(*unit) for unit in UNITS],
        "pretrain": [f"fold{fold}" for fold in FOLDS] if PRETRAINS else [],
        "pretrain_part": [
            f"fold{fold}/{part}" for fold in FOLDS for part in PARTS if PRETRAINS
        ],
        "train": [fold_folder(*fold) for fold in folds_of(UNITS)],
        "train_part": [
            f"{fold_folder(*fold)}/{part}" for fold in folds_of(UNITS) for part in PARTS
        ],
        "estimate": [fold_folder(*fold) for fold in folds_of(UNITS)],
        "lookup": [
            f"{fold_folder(*fold)}/{criterion}"
            for fold in folds_of(UNITS)
            for criterion in LOOKUP_CRITERIA
        ],
        "evaluate_baselines": [fold_folder(*fold) for fold in folds_of(UNITS)],
        "evaluate_recommended": [
            f"{fold_folder(*fold)}/{method}"
            for fold in folds_of(UNITS)
            for method in LOOKUP_METHODS
        ],
        "table": TABLES,
        "figure": SHOWN_FIGURES,
    }
    jobs = [
        (rule, f"{rule}/{name}") for rule, names in by_rule.items() for name in names
    ]
    return [*jobs, ("claims", "claims"), ("settings", "settings")]


# The reference that a run is compared with.


def reference_of_run(wildcards):
    """The reference to compare with, found before anything is run."""
    try:
        return str(find_reference(REFERENCES, CONFIG) / "configuration.yaml")
    except UserError as error:
        stop(error)


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


# Files of every elevation.


def at_every_elevation(path):
    return lambda wildcards: [
        path(wildcards.category, elevation, wildcards.fold)
        for elevation in CONFIG["elevations_deg"][wildcards.category]
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


# The runs that this one is compared with.


def compared_runs():
    """This run's name, then those that it is compared with."""
    return list(dict.fromkeys([CONFIG["name"], *CONFIG["compared_runs"]]))


def methods_in(run):
    """The paper's methods, and those that multiply an estimator's distributions."""
    extensions = run_settings(run)["extensions"].items()
    own = [name for name, method in extensions if method.get("fusion") == "product"]
    return [*run_settings(run)["methods"], *own]


def density_methods(run):
    """The methods whose errors tell what a density brings."""
    kinds = [
        "estimate",
        *(["posterior"] if run_settings(run)["gives_distributions"] else []),
    ]
    return sorted({name for kind in kinds for name in DENSITY_METHODS[kind].values()})


def compared_keys(names_of, units=None):
    """Run, category, elevation, fold, and one of the names that a run has, of every file."""
    return [
        (run, *fold, name)
        for run in compared_runs()
        for fold in folds_of(REFERENCE_UNITS if units is None else units)
        for name in names_of(run)
    ]


def compared(path, names_of, units=None):
    """The files of all runs. Those of other runs are not made here; they have to be there."""

    def files(wildcards):
        return [
            run_file(run, path(Layout(f"results/{run}"), *place), "compared_runs")
            for run, *place in compared_keys(names_of, units)
        ]

    return files


def proposed_lookup(run):
    methods, name = run_settings(run)["methods"], SETTINGS.subject
    if name not in methods or not needs_lookup(methods[name]["policy"]):
        stop(f"the run {run} has no lookup table of a method {name}")
    return [methods[name]["policy"]]


def estimated_roles(run):
    theirs = run_settings(run).get("calibration", "holdout")
    if theirs != CONFIG["calibration"]:
        stop(
            f"compared_runs: the run {run} has calibration={theirs}, this one "
            f"{CONFIG['calibration']}, so their calibration objects differ; leave it out"
        )
    return ESTIMATED_ROLES


def test_estimates(run):
    return ["test"]


def test_posteriors(run):
    return ["test"] if run_settings(run)["gives_distributions"] else []


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


@functools.cache
def kept_runs():
    """By run, the file that its estimates were kept in (None: this run's) and their keys."""
    if not CONFIG["confirmation"]["kept"]:
        keys = [
            (shuffle, replicate, *unit)
            for shuffle, replicate in REPLICATES
            for unit in LOWEST_UNITS
        ]
        return {CONFIG["name"]: (None, keys)}
    found = {}
    for path in CONFIG["confirmation"]["kept"]:
        try:
            settings, keys = kept_settings(path)
        except UserError as error:
            stop(f"confirmation.kept: {error}")
        run = settings["name"]
        if run in found:
            stop(
                f"confirmation.kept: {path} is of the run {run}, as {found[run][0]} is"
            )
        found[run] = (path, list(dict.fromkeys(key[:4] for key in keys)))
    return found


def kept_file(wildcards):
    path, _ = kept_runs()[wildcards.run]
    return path or LAYOUT.kept_estimates(wildcards.shuffle, wildcards.replicate)


def factorial_keys():
    return [(run, *key) for run, (_, keys) in kept_runs().items() for key in keys]


def per_attempt(amount):
    """A resource that grows with each attempt: its lack may be what ended the last one."""
    return lambda wildcards, attempt: amount * attempt


def banner(*lines):
    line = "-" * 72
    print("\n".join(["", line, *lines, line]), file=sys.stderr, flush=True)


def lift_rate_limit():
    """Let local jobs start as they can.

    Snakemake 9.27's rate limit starts a timer after each round of scheduling, and each timer
    starts another round while jobs are ready: 10,153 rounds instead of 303 for 302 jobs, 12.6 s
    of processor time instead of 6.1 s. No setting avoids it: a larger limit changes little
    (9,688 rounds), a longer time span delays the end by its length. The limit exists once the
    run starts.
    """
    if workflow.local_exec:
        workflow.scheduler.job_rate_limiter = None


def forget_last_error():
    """Begin with no error; the first thing that a run writes."""
    try:
        Path(LAYOUT.logs).mkdir(parents=True, exist_ok=True)
        Path(LAYOUT.last_error).unlink(missing_ok=True)
    except OSError as error:
        stop(f"{LAYOUT.root} cannot be written: {error.strerror}")


def reasons(logs):
    """What the run stopped for, with the help of Snakemake's own logs."""
    path = Path(LAYOUT.last_error)
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    # A job that had no time to begin its log is known to Snakemake alone.
    told = "".join(Path(log).read_text(encoding="utf-8") for log in logs)
    unknown = re.findall(r"(\w+)\.py' died with <Signals.SIGKILL", told)
    killed = killed_jobs(LAYOUT.logs, STARTED) or unknown
    if not killed:
        return lines
    return [
        *lines,
        f"error: killed from outside: {', '.join(killed)}",
        "most often memory ran out: use fewer --cores, or smaller settings",
    ]

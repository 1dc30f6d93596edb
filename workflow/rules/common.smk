# The configuration, and the functions of the rule files.

import os
import re
import sys
import time
from pathlib import Path

try:
    import nbv
except ModuleNotFoundError:
    sys.exit(
        "nbv: error: the package is not installed here: run make, or pip install --editable .[experiment]"
    )

from nbv.experiment import provenance
from nbv.robot.pairs import PairTable
from nbv.experiment.config import load_config, snakemake_overrides
from nbv.errors import UserError
from nbv.experiment.estimation.warm_start import (
    PRETRAINED,
    STAGES,
    stage_from,
    stage_settings,
    start_of,
)
from nbv.experiment.results import ESTIMATED_ROLES
from nbv.experiment.run_size import too_small
from nbv.experiment.jobs import LAST_ERROR, why_stopped
from nbv.experiment.layout import Layout, bundle_variant, fold_folder, unit_folder
from nbv.data.sources import SOURCES, open_source, select_objects
from nbv.data.meshes import stored_ids
from nbv.experiment.processes import hold_lock
from nbv.core.criteria import CRITERIA
from nbv.core.selection import check_methods
from nbv.core.policies import needs_lookup
from nbv.data.render import RENDERERS
from nbv.data.sensors import SENSORS, check_sensor, sensor_settings

BASE = Path(workflow.basedir)
STARTED = time.time()
# Held until this process ends, so it has a name.
RUN_LOCK = hold_lock(Path(".snakemake"))


def stop(message):
    """End with one line: nothing has been started yet."""
    sys.exit(f"nbv: error: {message}")


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
    if category != "mug":
        settings["handle_reach"] = settings["square_share"] = 0.0
    return settings | {"exclude": [], "exclude_file": None}


try:
    OVERRIDES = snakemake_overrides(config)
    CONFIG = load_config(BASE / "config", OVERRIDES)
    LAYOUT = Layout(f"results/{CONFIG['name']}")
    CATEGORIES = CONFIG["categories"]
    # Estimates come from a file of another program.
    EXTERNAL = "pairs" in CONFIG["estimator"]
    METHODS, EXTENSIONS = CONFIG["methods"], CONFIG["extensions"]
    check_methods(METHODS, EXTENSIONS, CONFIG["gives_distributions"])
    check_sensor(CONFIG["sensor"], CATEGORIES)
    if EXTERNAL:
        pairs = PairTable.load(CONFIG["estimator"]["pairs"])
        pairs.check_classes(CONFIG["estimator"].get("n_classes"))
        OBJECTS = pairs.objects(
            {name: CONFIG["elevations_deg"][name] for name in CATEGORIES}
        )
    else:
        OBJECTS = {category: selected_objects(category) for category in CATEGORIES}
except UserError as error:
    stop(error)
except OSError as error:
    stop(f"dataset.root: {error.filename} cannot be read: {error.strerror}")

# What every table, the page and the last lines say of a run whose numbers mean nothing.
CAUTION = too_small(
    {category: len(ids) for category, ids in OBJECTS.items()},
    None if EXTERNAL else CONFIG["estimator"]["epochs"],
)
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
# The wildcards of a unit and of a fold, as the paths of `nbv.experiment.layout` take them.
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
    """The files of nbv that a script depends on, as inputs: an edit reruns what uses them."""
    sensor = settings["sensor"]["name"]
    drawn_by = [
        RENDERERS[settings["renderer"]["name"]],
        *([SENSORS[sensor]] if sensor in SENSORS else []),
    ]
    chosen = {
        "prepare_meshes": [SOURCES[settings["dataset"]["source"]]],
        "render_depth": drawn_by,
        "render_bundle": drawn_by,
    }
    path = SCRIPTS / f"{script}.py"
    files = provenance.source_files(path, chosen.get(script, []))
    here = Path.cwd()
    return [
        str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
        for file in files
    ]


def need_meshes():
    """End with one line where the estimator is external."""
    if EXTERNAL:
        stop(
            f"estimator={CONFIG['estimator']['kind']} has no meshes, images or trainings, and what was asked for needs "
            "them: ask for the report (no target), extensions or leaderboard, or choose another "
            "estimator"
        )


def mesh_sources(wildcards):
    """The modules that meshes depend on."""
    need_meshes()
    return sources("prepare_meshes")


def all_sources():
    """The modules that the results as a whole depend on."""
    scripts = SCRIPTS.glob("*.py")
    return sorted({file for script in scripts for file in sources(script.stem)})


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


def estimates_of_fold(layout=LAYOUT):
    """The files of a fold's estimates by name, and those of distributions."""
    estimates = {role: layout.estimates(*FOLD, role) for role in ESTIMATED_ROLES}
    return posteriors_of_fold(layout) | estimates


def estimates_of_training(layout=LAYOUT):
    """The estimates that a training makes: a fold's, or none where `estimate` makes them."""
    return {} if CROSSFIT or EXTERNAL else estimates_of_fold(layout)


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
    start = start_of_unit(wildcards.category, int(wildcards.elevation))
    return STAGE_SETTINGS[stage_from(start)]


# What bundles are made of.


def elevations_of_bundle(path, of_ingredient=True):
    """The path of every elevation of the wildcards' category, without their ingredient."""

    def found(wildcards):
        need_bundle_settings(wildcards.category)
        without = VARIANTS[wildcards.variant][0] if of_ingredient else ""
        elevations = CONFIG["elevations_deg"][wildcards.category]
        places = [
            (wildcards.category, each, bundle_variant(without)) for each in elevations
        ]
        return paths(path, places)

    return found


def files_of_manifest(path):
    """A manifest, and the frames and masks that it names."""
    from nbv.robot.recordings import read_manifest  # only here: it is slow

    try:
        recordings = read_manifest(path)
    except UserError as error:
        stop(f"bundles.frames: {error}")
    columns = [
        one.frames[name]
        for one in recordings
        for name in ("path", "mask")
        if name in one.frames
    ]
    return [path, *(file for column in columns for file in column if file)]


def need_bundle_settings(category):
    """End with one line where settings make no bundle."""
    need_meshes()
    if CONFIG["camera"]["framing"] != "silhouette":
        stop(
            f"camera.framing={CONFIG['camera']['framing']}: a bundle's frames are centred on what "
            "is visible; give silhouette"
        )
    if CONFIG["calibration"] != "holdout":
        stop(f"calibration={CONFIG['calibration']}: a bundle needs calibration=holdout")
    if not CONFIG["gives_distributions"]:
        stop("estimator=regressor: a bundle needs estimator=classifier")
    if category not in CONFIG["sensor"]["diagonal_m"]:
        stop(
            f"sensor.diagonal_m.{category}: a bundle needs the object's diagonal, metres"
        )


def randomisation_of(wildcards):
    without, _ = VARIANTS[wildcards.variant]
    return CONFIG["randomisation"] | INGREDIENTS.get(without, {})


def bundle_settings(wildcards):
    """What a bundle says of its training."""
    said = {key: CONFIG[key] for key in ("dataset", "sensor", "seed")}
    _, replicate = VARIANTS[wildcards.variant]
    return (
        said
        | {"randomisation": randomisation_of(wildcards)}
        | ({"replicate": replicate} if replicate else {})
    )


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
        "meshes": [] if EXTERNAL else CATEGORIES,
        "splits": CATEGORIES,
        "render": [] if EXTERNAL else [unit_folder(*unit) for unit in UNITS],
        "pretrain": [f"fold{fold}" for fold in FOLDS] if PRETRAINS else [],
        "pretrain_part": [
            f"fold{fold}/{part}" for fold in FOLDS for part in PARTS if PRETRAINS
        ],
        "train": [] if EXTERNAL else [fold_folder(*fold) for fold in folds_of(UNITS)],
        "train_part": [
            f"{fold_folder(*fold)}/{part}" for fold in folds_of(UNITS) for part in PARTS
        ],
        "estimate": [
            fold_folder(*fold) for fold in folds_of(UNITS) if CROSSFIT or EXTERNAL
        ],
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


def per_attempt(amount):
    """A resource that grows with each attempt: its lack may be what ended the last one."""
    return lambda wildcards, attempt: amount * attempt


def banner(*lines):
    line = "-" * 72
    print("\n".join(["", line, *lines, line]), file=sys.stderr, flush=True)


def forget_last_error():
    """Begin with no error; the first thing that a run writes."""
    try:
        Path(LAYOUT.logs).mkdir(parents=True, exist_ok=True)
        Path(LAYOUT.logs, LAST_ERROR).unlink(missing_ok=True)
    except OSError as error:
        stop(f"{LAYOUT.root} cannot be written: {error.strerror}")

# The configuration, and what the other rule files share.

import re
import sys
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
from nbv.errors import UserError
from nbv.layout import Layout, fold_folder, unit_folder
from nbv.meshes.sources import SOURCES, open_source, select_objects
from nbv.meshes.store import stored_ids
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.method_selection import check_methods
from nbv.recommendation.policies import needs_lookup
from nbv.rendering import RENDERERS
from nbv.rendering.noise import SENSORS, check_sensor, sensor_settings

BASE = Path(workflow.basedir)


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
    return settings | {"exclude": [], "exclude_file": None}


try:
    OVERRIDES = snakemake_overrides(config)
    CONFIG = load_config(BASE / "config", OVERRIDES)
    LAYOUT = Layout(f"results/{CONFIG['name']}")
    CATEGORIES = CONFIG["categories"]
    METHODS, EXTENSIONS = CONFIG["methods"], CONFIG["extensions"]
    check_methods(METHODS, EXTENSIONS, CONFIG["gives_distributions"])
    check_sensor(CONFIG["sensor"], CATEGORIES)
    OBJECTS = {category: selected_objects(category) for category in CATEGORIES}
except UserError as error:
    stop(error)

# What decides on a rotation: the conditionals, and the cost of travel.
DECISION = CONFIG["density"] | CONFIG["recommendation"]
LOOKUP_METHODS = [name for name in METHODS if needs_lookup(METHODS[name]["policy"])]
BASELINE_METHODS = [name for name in METHODS if name not in LOOKUP_METHODS]
LOOKUP_CRITERIA = sorted({METHODS[name]["policy"] for name in LOOKUP_METHODS})
FOLDS = range(1, CONFIG["n_folds"] + 1)
# Parts of a fold's training objects, where calibration is cross-fitted.
CROSSFIT = CONFIG["calibration"] == "crossfit"
PARTS = range(1, CONFIG["crossfit_parts"] + 1) if CROSSFIT else []
# A unit is a category at an elevation. Each fold of a unit has an estimator of its own.
UNITS = [
    (category, elevation)
    for category in CATEGORIES
    for elevation in CONFIG["elevations_deg"][category]
]
# The wildcards of a unit and of a fold, as the paths of `nbv.layout` take them.
UNIT = ("{category}", "{elevation}")
FOLD = (*UNIT, "{fold}")
# Used with --software-deployment-method conda; otherwise jobs run where snakemake does.
ENVIRONMENT = "../environment.yaml"


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
    path = BASE / "workflow/scripts" / f"{script}.py"
    files = provenance.source_files(path, chosen.get(script, []))
    here = Path.cwd()
    return [
        str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
        for file in files
    ]


def all_sources():
    """The modules that the results as a whole depend on."""
    scripts = (BASE / "workflow/scripts").glob("*.py")
    return sorted({file for script in scripts for file in sources(script.stem)})


def run_settings(run):
    """The configuration of a finished run."""
    if run == CONFIG["name"]:
        return CONFIG
    try:
        return read_configuration(Path("results") / run)
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


def last_error():
    path = Path(LAYOUT.last_error)
    return path.read_text().splitlines() if path.exists() else []

# Configuration, names and helpers that the other rule files share.

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
from nbv.config import load_condition, load_config, snakemake_overrides
from nbv.errors import UserError
from nbv.experiments.image_distributions import METHODS as BELIEF_METHODS
from nbv.recommendation.method_selection import check_contenders
from nbv.experiments.two_views import check_method
from nbv.meshes.sources import SOURCES, open_source, select_objects
from nbv.meshes.store import stored_ids
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.policies import needs_lookup
from nbv.rendering import RENDERERS
from nbv.rendering.noise import SENSORS, check_sensor, sensor_settings

BASE = Path(workflow.basedir)
SOURCE_ROOT = Path(nbv.__file__).parents[1]


def stop(message):
    """End with one line: nothing has been started yet."""
    sys.exit(f"nbv: error: {message}")


def chosen_objects(category):
    """The objects of a category, by name; those of the last run where the data set is gone."""
    root = CONFIG["dataset"]["root"]
    prepared = Path(f"{RESULTS}/meshes/{category}.npz")
    if root and not Path(root).expanduser().exists() and prepared.exists():
        return stored_ids(prepared)
    source = open_source(CONFIG["dataset"], CONFIG["seed"])
    return select_objects(source, category, CONFIG["n_objects"])


def dataset_of(category):
    """What of the data set's settings concerns one category, the objects left out apart."""
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
    RESULTS = f"results/{CONFIG['name']}"
    CATEGORIES = CONFIG["categories"]
    for name, method in CONFIG["methods"].items():
        check_method(name, method)
    check_contenders(CONFIG["contenders"], CONFIG["methods"])
    check_sensor(CONFIG["sensor"], CATEGORIES)
    LOOKUP_METHODS = [
        name
        for name, method in CONFIG["methods"].items()
        if needs_lookup(method["rotation"])
    ]
    OBJECTS = {category: chosen_objects(category) for category in CATEGORIES}
except UserError as error:
    stop(error)

# What decides on a rotation: the density, and what travelling costs.
DECISION = CONFIG["density"] | CONFIG["recommendation"]
LOOKUP_ROTATIONS = sorted(
    {CONFIG["methods"][name]["rotation"] for name in LOOKUP_METHODS}
)
# Used with --software-deployment-method conda; otherwise jobs run where snakemake does.
ENVIRONMENT = "../environment.yaml"
LAST_ERROR = f"{RESULTS}/logs/last_error.txt"
FOLDS = range(1, CONFIG["n_folds"] + 1)
BASELINE_METHODS = [name for name in CONFIG["methods"] if name not in LOOKUP_METHODS]
# Parts of a fold's training objects, where calibration is cross-fitted.
CROSSFIT = CONFIG["calibration"] == "crossfit"
PARTS = range(1, CONFIG["crossfit_parts"] + 1) if CROSSFIT else []
# A unit is what has an estimator of its own in each fold: a category at an elevation.
FOLD = "{category}/el{elevation}/fold{fold}"
UNITS = [
    (category, elevation)
    for category in CATEGORIES
    for elevation in CONFIG["elevations_deg"][category]
]


wildcard_constraints:
    category="|".join(map(re.escape, CATEGORIES)),
    elevation=r"\d\d",
    fold="|".join(map(str, FOLDS)),
    part="|".join(map(str, PARTS)) or "none",
    method="|".join(map(re.escape, LOOKUP_METHODS)) or "none",
    criterion="|".join(LOOKUP_ROTATIONS) or "none",


def script_path(name):
    return f"../scripts/{name}.py"


def sources(name, settings=CONFIG):
    """The package's modules that a script depends on: an edit reruns what uses them."""
    script = BASE / "workflow/scripts" / f"{name}.py"
    sensor = settings["sensor"]["name"]
    chosen = {
        "meshes": [SOURCES[settings["dataset"]["source"]]],
        "render": [
            RENDERERS[settings["renderer"]["name"]],
            *([SENSORS[sensor]] if sensor in SENSORS else []),
        ],
    }
    files = provenance.source_files(script, SOURCE_ROOT, chosen.get(name, []))
    here = Path.cwd()
    return [
        str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
        for file in files
    ]


def all_sources():
    """What the results as a whole were made with."""
    scripts = (BASE / "workflow/scripts").glob("*.py")
    return sorted({file for script in scripts for file in sources(script.stem)})


def has_posteriors(configuration):
    """Whether a run's estimator has classes, and so says how likely each azimuth is."""
    return "n_classes" in configuration["estimator"]


def evaluated(configuration):
    """The names of the errors in a run's folder `evaluation`."""
    own = BELIEF_METHODS if has_posteriors(configuration) else ()
    return [*configuration["methods"], *own]


def unit_names(units):
    return [f"{category}/el{elevation:02d}" for category, elevation in units]


def per_fold(stage, names):
    return expand(
        f"{RESULTS}/{stage}/{{unit}}/fold{{fold}}/{{name}}",
        unit=unit_names(UNITS),
        fold=FOLDS,
        name=names,
    )


def recommending_lookup(wildcards):
    rotation = CONFIG["methods"][wildcards.method]["rotation"]
    return f"{RESULTS}/lookup/{FOLD}/{rotation}.npz"


def log_path(job):
    return f"{RESULTS}/logs/{job}.log"


def benchmark_path(job):
    return f"{RESULTS}/benchmarks/{job}.tsv"


def banner(*lines):
    line = "-" * 72
    print("\n".join(["", line, *lines, line]), file=sys.stderr, flush=True)


def lift_rate_limit():
    """Let local jobs start as they can.

    With its default limit of 100 jobs a second, Snakemake 9.27 looks at the schedule again once a
    second for every job that has been started so far (as its pull request 3744 describes): a
    fifth of a core at the end of the paper's run. The limit exists once the run starts.
    """
    if workflow.local_exec:
        workflow.scheduler.job_rate_limiter = None


def last_error():
    path = Path(LAST_ERROR)
    return path.read_text().splitlines() if path.exists() else []

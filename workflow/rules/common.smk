# Configuration, names and helpers that the other rule files share.

import os
import sys
from pathlib import Path

BASE = Path(workflow.basedir)
SOURCE_ROOT = BASE / "src"
# Scripts run in processes of their own; they are to find the same sources as this file.
sys.path.insert(0, str(SOURCE_ROOT))
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(SOURCE_ROOT), os.environ.get("PYTHONPATH")])
)

from nbv import provenance
from nbv.config import load_config, snakemake_overrides
from nbv.errors import UserError
from nbv.evaluation.methods import needs_lookup
from nbv.meshes.sources import SOURCES, open_source, select_objects
from nbv.rendering import RENDERERS


def stop(message):
    """End with one line: nothing has been started yet."""
    sys.exit(f"nbv: error: {message}")


def check_meshes_are_there():
    """Look for each category's files, unless its meshes have been prepared already."""
    for category in CATEGORIES:
        if not Path(f"{RESULTS}/meshes/{category}.npz").exists():
            source = open_source(CONFIG["dataset"], CONFIG["seed"])
            select_objects(source, category, CONFIG["n_objects"])


try:
    CONFIG = load_config(BASE / "config", snakemake_overrides(config))
    RESULTS = f"results/{CONFIG['name']}"
    CATEGORIES = CONFIG["categories"]
    LOOKUP_METHODS = [
        name for name, method in CONFIG["methods"].items() if needs_lookup(method["rotation"])
    ]
    check_meshes_are_there()
except UserError as error:
    stop(error)

LOOKUP_ROTATIONS = sorted({CONFIG["methods"][name]["rotation"] for name in LOOKUP_METHODS})
LAST_ERROR = f"{RESULTS}/logs/last_error.txt"
FOLDS = range(1, CONFIG["n_folds"] + 1)
BASELINE_METHODS = [name for name in CONFIG["methods"] if name not in LOOKUP_METHODS]
# A unit is what has an estimator of its own in each fold: a category at an elevation.
UNITS = [
    f"{category}/el{elevation:02d}"
    for category in CATEGORIES
    for elevation in CONFIG["elevations_deg"][category]
]


wildcard_constraints:
    category="[^/]+",
    elevation=r"\d\d",
    fold=r"\d+",
    method="|".join(LOOKUP_METHODS) or "none",


def script_path(name):
    return f"../scripts/{name}.py"


def sources(name, *chosen):
    """The package's modules that a script depends on: an edit reruns what uses them."""
    script = BASE / "workflow/scripts" / f"{name}.py"
    files = provenance.source_files(script, SOURCE_ROOT, chosen)
    here = Path.cwd()
    return [
        str(Path(file).relative_to(here)) if Path(file).is_relative_to(here) else file
        for file in files
    ]


def per_fold(stage, names):
    return expand(
        f"{RESULTS}/{stage}/{{unit}}/fold{{fold}}/{{name}}", unit=UNITS, fold=FOLDS, name=names
    )


def log_path(stage, wildcards=""):
    return f"{RESULTS}/logs/{stage}{wildcards}.log"


def benchmark_path(stage, wildcards=""):
    return f"{RESULTS}/benchmarks/{stage}{wildcards}.tsv"


def banner(*lines):
    line = "-" * 72
    print("\n".join(["", line, *lines, line]), file=sys.stderr, flush=True)


def last_error():
    path = Path(LAST_ERROR)
    return path.read_text().splitlines() if path.exists() else []

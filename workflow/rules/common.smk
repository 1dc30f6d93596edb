# The plan of the run, where its files lie, and the functions of the rule files. The studies' own
# Snakefile includes this file too. Rules write paths and not, say, `rules.train.output`: where a
# study uses `train` with other outputs, that would be the study's.

import os
import re
import sys
from contextlib import contextmanager
from pathlib import Path

try:
    import nbv
except ModuleNotFoundError:
    sys.exit(
        "nbv: error: the package is not installed here: run make, or pip install --editable .[experiment]"
    )

from nbv.data.sensors import sensor_settings
from nbv.errors import UserError
from nbv.experiment.config import snakemake_overrides
from nbv.experiment.run.jobs import begin_run, check_folders, why_stopped
from nbv.experiment.estimation.features import SHIPPED
from nbv.experiment.plan import Plan, paths
from nbv.experiment.run.reference import find_reference
from nbv.experiment.results import ESTIMATED_ROLES
from nbv.experiment.stages import FEATURES, PRETRAINED, stage_from

# Figures need no backend, and one that is unknown here, such as Jupyter's, ends the import of
# matplotlib, in this process and in its jobs.
os.environ.pop("MPLBACKEND", None)
# Neither the Snakefile that was started nor the working directory need be the project's: a Snakefile
# elsewhere can use this one as a module.
ROOT = Path(workflow.current_basedir).parents[1]


@contextmanager
def one_line():
    """End with one line where a setting is wrong: nothing has been started yet."""
    try:
        yield
    except UserError as error:
        sys.exit(f"nbv: error: {error}")


with one_line():
    PLAN = Plan.load(ROOT / "config", tuple(snakemake_overrides(config)))
    check_folders(PLAN.results)

CONFIG, UNITS = PLAN.config, PLAN.units
FOLDS = "|".join(map(str, PLAN.folds))
ELEVATIONS = "|".join(sorted({f"{elevation:02d}" for _, elevation in UNITS}))
METHODS = CONFIG["methods"]
REFERENCES = Path(os.path.relpath(ROOT / "docs/reference"))
# Used with --software-deployment-method conda; otherwise jobs run where snakemake does.
ENVIRONMENT = str(ROOT / "workflow/environment.yaml")


pathvars:
    results=PLAN.results,
    logs=f"{PLAN.results}/logs",
    benchmarks=f"{PLAN.results}/benchmarks",


wildcard_constraints:
    category="|".join(map(re.escape, CONFIG["categories"])),
    elevation=ELEVATIONS,
    fold=FOLDS,
    part="|".join(map(str, PLAN.parts)) or "none",
    criterion="|".join(PLAN.lookup_criteria) or "none",


def sources(script, settings=None):
    """The files that a script depends on, as inputs: an edit reruns what uses them."""
    (path,) = ROOT.glob(f"*/scripts/{script}.py")
    return PLAN.sources(path, settings)


@one_line()
def mesh_sources(wildcards):
    """The files that meshes depend on."""
    PLAN.check_images()
    return sources("prepare_meshes")


def per_attempt(amount):
    """A resource that grows with each attempt: its lack may be what ended the last one."""
    return lambda wildcards, attempt: amount * attempt


# Estimates, and what a training starts from. `below` is the folder of the training.


def estimates_of_fold(below="<results>"):
    """The files of a fold's estimates by name, and those of distributions."""
    folder = f"{below}/estimates/{{category}}/el{{elevation}}/fold{{fold}}"
    posteriors = {
        f"{role}_posteriors": f"{folder}/{role}_posteriors.npz"
        for role in ESTIMATED_ROLES
        if CONFIG["gives_distributions"]
    }
    return posteriors | {role: f"{folder}/{role}.csv" for role in ESTIMATED_ROLES}


def fits_of_folds(below="<results>"):
    """The estimates and the linear estimators of all folds, by name."""
    folder = f"{below}/estimators/{{category}}/el{{elevation}}/fold{{fold}}"
    files = {"estimator": f"{folder}/estimator.safetensors"} | estimates_of_fold(below)
    return {
        name: expand(path, fold=PLAN.folds, allow_missing=True)
        for name, path in files.items()
    }


def estimates_of_training(below="<results>"):
    """The estimates that a training makes: a fold's, or none where `estimate` makes them."""
    return {} if PLAN.estimates_apart else estimates_of_fold(below)


def folds_if(made):
    """All folds, or none where another rule makes the files."""
    return FOLDS if made else "none"


def estimated_from(wildcards):
    """What a fold's estimates are made of: another program's file, or images and estimators."""
    splits = "<results>/splits/{category}.csv"
    if PLAN.external:
        return {"splits": splits, "pairs": CONFIG["estimator"]["pairs"]}
    images = "<results>/depth/{category}/el{elevation}"
    estimators = "<results>/estimators/{category}/el{elevation}/fold{fold}"
    return {
        "splits": splits,
        "depth": f"{images}.npy",
        "objects": f"{images}_objects.json",
        "estimator": f"{estimators}/estimator.safetensors",
        "of_parts": [
            f"{estimators}/without_part{part}.safetensors" for part in PLAN.parts
        ],
    }


def training_start(wildcards, below="<results>"):
    """The estimators that a training starts from: one, or none where the weights are random."""
    start = PLAN.start(wildcards.category, int(wildcards.elevation))
    if start is None:
        return []
    if start == FEATURES:
        return [os.path.relpath(SHIPPED)]
    unit = (
        "pretrained" if start == PRETRAINED else f"{wildcards.category}/el{start:02d}"
    )
    part = wildcards.get("part")
    name = "estimator" if part is None else f"without_part{part}"
    return [f"{below}/estimators/{unit}/fold{wildcards.fold}/{name}.safetensors"]


BUNDLE_START = [os.path.relpath(SHIPPED)] if PLAN.bundle_stage == "fine_tuning" else []


@one_line()
def settings_of(stage):
    """The settings of a stage of training."""
    return PLAN.stage(stage)


def stage_of(wildcards):
    """The settings of a training."""
    start = PLAN.start(wildcards.category, int(wildcards.elevation))
    return settings_of(stage_from(start))


@one_line()
def bundle_elevations(wildcards, pattern):
    """The path of every elevation of a category that can have a bundle."""
    PLAN.check_bundle(wildcards.category)
    elevations = CONFIG["elevations_deg"][wildcards.category]
    return paths(pattern, [(wildcards.category, each) for each in elevations])


@one_line()
def what_exists(wildcards):
    """No input: a path is of a fold or an elevation that the run does not have."""
    units = ", ".join(paths("{category}/el{elevation}", UNITS))
    raise UserError(
        f"{PLAN.results}/{wildcards.missing} is not of this run, which has {units}, each with "
        f"fold1 to fold{CONFIG['n_folds']}"
    )


@one_line()
def reference_of_run(wildcards):
    """The reference to compare with, found before anything is run."""
    return str(find_reference(REFERENCES, CONFIG) / "configuration.yaml")


def lines_of_bundles():
    """What is said of the bundles that a run of bundles has made."""
    from nbv.experiment.statistics.bundle import bundle_lines

    made = paths(
        f"{PLAN.results}/bundles/{{category}}.safetensors", zip(CONFIG["categories"])
    )
    return [
        line
        for path in map(Path, made)
        if path.is_file()
        for line in bundle_lines(path)
    ]


def banner(*lines):
    line = "-" * 72
    print("\n".join(["", line, *lines, line]), file=sys.stderr, flush=True)


onstart:
    with one_line():
        begin_run(PLAN.results)
    banner(
        f"nbv: experiment {CONFIG['experiment']}, data set {CONFIG['dataset']['source']}, "
        f"{len(UNITS)} units of {CONFIG['n_folds']} folds",
        f"results: {PLAN.results}/    logs: {PLAN.results}/logs/",
        *PLAN.unmirrored,
        *PLAN.caution,
    )


onsuccess:
    report = f"{PLAN.results}/report.html"
    # A run of some tables alone has none.
    read_first = f"    read first: {report}" if Path(report).is_file() else ""
    banner(
        "nbv: finished",
        f"results: {PLAN.results}/{read_first}",
        *lines_of_bundles(),
        *PLAN.caution,
    )


onerror:
    banner(
        "nbv: stopped",
        *why_stopped(PLAN.results),
        "what was finished is kept; the same command goes on from there",
        f"logs: {PLAN.results}/logs/",
    )

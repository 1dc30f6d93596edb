# What the reading rules share: which units a table or figure is about, and the files it needs.

import os

from nbv.reporting.paper.figures import FIGURES
from nbv.reference.store import find_reference
from nbv.config import read_configuration
from nbv.reporting.settings import (
    ReadingSettings,
    focus_category,
    focus_unit,
    reference_units,
)
from nbv.reporting.paper.tables import TABLES

SHOWN = {"methods": list(CONFIG["methods"])}
# Figures show no intervals.
RESAMPLED = SHOWN | {"n_resamples": CONFIG["n_resamples"], "seed": CONFIG["seed"]}
REFERENCE_UNITS = reference_units(UNITS, ReadingSettings())
READING_SETTINGS = ReadingSettings(focus_category=CONFIG["focus_category"])
FOCUS = focus_category(UNITS, READING_SETTINGS)
# Of the focus category at every elevation, or at the reference elevation alone; all other tables
# and figures compare the categories.
OF_ELEVATIONS = {"table2", "table4", "figure6"}
OF_FOCUS = {
    *("table5", "table6", "table7"),
    *("figure2", "figure3", "figure7", "figure8", "heatmaps"),
}


def units_of(name):
    if name in OF_ELEVATIONS:
        return [unit for unit in UNITS if unit[0] == FOCUS]
    if name in OF_FOCUS:
        return [focus_unit(UNITS, READING_SETTINGS)]
    return REFERENCE_UNITS


def shown(settings, name):
    """What of the reading settings a table or figure depends on."""
    of_focus = name in OF_ELEVATIONS | OF_FOCUS
    return settings | ({"focus_category": FOCUS} if of_focus else {})


def evaluations_of(units):
    return expand(
        f"{RESULTS}/evaluation/{{unit}}/fold{{fold}}/{{method}}.csv",
        unit=unit_names(units),
        fold=FOLDS,
        method=CONFIG["methods"],
    )


def figure_inputs(wildcards):
    units, needs = units_of(wildcards.figure), FIGURES[wildcards.figure].needs
    files = evaluations_of(units)
    if "depth" in needs:
        files += expand(f"{RESULTS}/depth/{{unit}}.npy", unit=unit_names(units))
    if "splits" in needs:
        files += expand(
            f"{RESULTS}/splits/{{category}}.csv", category={unit[0] for unit in units}
        )
    if "lookup" in needs:
        files += expand(
            f"{RESULTS}/lookup/{{unit}}/fold{{fold}}/entropy.npz",
            unit=unit_names(units),
            fold=FOLDS,
        )
    return sorted(files)


REFERENCES = Path(os.path.relpath(BASE / "docs/reference"))


def reference_of_run(wildcards):
    """The reference to compare with, looked for before anything is run."""
    try:
        return str(find_reference(REFERENCES, CONFIG) / "configuration.yaml")
    except UserError as error:
        stop(error)


def runs_beside():
    """Configurations of this run and those beside it, by name, this one first."""
    runs = {CONFIG["name"]: CONFIG}
    for name in CONFIG["beside"]:
        if name not in runs:
            try:
                runs[name] = read_configuration(Path("results") / name)
            except UserError as error:
                stop(f"beside: {error}")
    return runs


def files_of_runs(files_of):
    """What a table reads of every run; other runs' files are not made here, and have to be there."""
    found = []
    for name, configuration in runs_beside().items():
        files = expand(
            f"results/{name}/{{file}}",
            file=[
                path
                for unit in unit_names(REFERENCE_UNITS)
                for fold in FOLDS
                for path in files_of(f"{unit}/fold{fold}", configuration)
            ],
        )
        missing = [path for path in files if not Path(path).exists()]
        if missing and name != CONFIG["name"]:
            stop(f"beside: {missing[0]} does not exist; finish the run {name} first")
        found += files
    return found


def likelihood_files(place, configuration):
    methods, files = ["single", "opposite", "proposed"], ["estimates/{}/test.csv"]
    files.append("lookup/{}/entropy.npz")
    if has_posteriors(configuration):
        methods += BELIEF_METHODS
        files.append("estimates/{}/test_posteriors.npz")
    files += [f"evaluation/{{}}/{name}.csv" for name in methods]
    return [name.format(place) for name in files]


def evaluation_files(place, configuration):
    return [f"evaluation/{place}/{name}.csv" for name in evaluated(configuration)]

# What the reading rules share: which units a table or figure is about, and the files it needs.

import os

from nbv.evaluation.figures import FIGURES
from nbv.evaluation.reference import find_reference
from nbv.evaluation.settings import (
    ReadingSettings,
    focus_category,
    focus_unit,
    reference_units,
)
from nbv.evaluation.tables import TABLES

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

# What the reading rules share: which units a table or figure is about, and the files it needs.

from nbv.evaluation.figures import FIGURES
from nbv.evaluation.settings import ReadingSettings, focus_category, reference_units
from nbv.evaluation.tables import TABLES

READING = {
    "methods": list(CONFIG["methods"]),
    "focus_category": CONFIG["focus_category"],
    "n_resamples": CONFIG["n_resamples"],
    "seed": CONFIG["seed"],
}
REFERENCE_UNITS = reference_units(UNITS, ReadingSettings())
FOCUS = focus_category(UNITS, ReadingSettings(focus_category=CONFIG["focus_category"]))
FOCUS_UNITS = [unit for unit in UNITS if unit[0] == FOCUS]
# Tables and figures of the focus category alone; all others compare the categories.
OF_FOCUS = {"table2", "table4", "table5", "table6", "table7"} | {
    "figure2",
    "figure3",
    "figure6",
    "figure7",
    "figure8",
    "heatmaps",
}


def units_of(name):
    return FOCUS_UNITS if name in OF_FOCUS else REFERENCE_UNITS


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

# What tables and figures are about, and what Snakemake's own report (snakemake --report report.zip)
# says of each result.


def evaluations_for(name):
    """Category, elevation, fold and method of every evaluation of a table or figure."""
    return PLAN.evaluations_of(PLAN.units_of(name))


def figure_inputs(wildcards):
    """The files that a figure needs."""
    name = wildcards.figure
    units, needs = PLAN.units_of(name), FIGURES[name].needs
    lookup = "<results>/lookup/{category}/el{elevation}/fold{fold}"
    found = {
        "evaluations": paths(
            "<results>/evaluation/{category}/el{elevation}/fold{fold}/{method}.csv",
            evaluations_for(name),
        ),
        "depth": paths("<results>/depth/{category}/el{elevation}.npy", units),
        "objects": paths(
            "<results>/depth/{category}/el{elevation}_objects.json", units
        ),
        "lookups": paths(f"{lookup}/{PROPOSED_LOOKUP}.npz", PLAN.folds_of(units)),
    }
    return {kind: found[kind] for kind in found if kind in ("evaluations", *needs)}


@one_line()
def steps_animation(wildcards):
    """The animation, where the run has what it shows."""
    if "steps" not in SHOWN_FIGURES:
        raise UserError("animation needs depth images and a lookup table of proposed")
    return "<results>/figures/steps.gif"


TABLES_SHOW = {
    "table1": "mean absolute error by category",
    "table2": "mean absolute error by elevation",
    "table3": "pAUC by category",
    "table4": "pAUC by elevation",
    "table5": "mean absolute error by group of initial viewpoints",
    "table6": "estimates of single images, and their errors",
    "table7": "mean absolute error and pAUC by fold",
}


def numbered(table):
    return table.replace("table", "Table ")


PAGES_SHOW = {
    "claims": "The paper's claims: which hold, which do not, which are undecided, and why.",
    "report": "The page of the run: claims, tables, figures, settings, running time.",
    "runtime": "What the jobs of each rule cost.",
}


def caption_of(shows, units):
    """What the captions say of a result, as a parameter of its rule."""
    return {
        "shows": shows,
        "objects": {category: len(PLAN.objects[category]) for category, _ in units},
        "n_folds": CONFIG["n_folds"],
        "seed": CONFIG["seed"],
    }


def caption_of_table(wildcards):
    name = wildcards.table
    shows = f"{numbered(name)}: {TABLES_SHOW[name]}, ours next to the published values."
    return caption_of(shows, PLAN.units_of(name))


def caption_of_figure(wildcards):
    name = wildcards.figure
    return caption_of(FIGURES[name].caption, PLAN.units_of(name))


def in_report(path, category, caption, labels):
    """A file that Snakemake's report shows under a category, with labels to choose it by."""
    return report(
        path, caption=f"../report/{caption}.rst", category=category, labels=labels
    )


def table_in_report(kind, form):
    """A table of the paper, as a table or as its numbers."""
    return in_report(
        f"<results>/tables/{{table}}.{kind}",
        "Tables",
        "result",
        lambda wildcards: {
            "table": numbered(wildcards.table),
            "shows": TABLES_SHOW[wildcards.table],
            "form": form,
        },
    )

# What Snakemake's own report (snakemake --report report.zip) says of each result.

config["captions"] = {
    "name": CONFIG["name"],
    "dataset": CONFIG["dataset"]["source"],
    "estimator": CONFIG["estimator"]["kind"],
    "n_folds": CONFIG["n_folds"],
    "seed": CONFIG["seed"],
    "objects": {category: len(OBJECTS[category]) for category in CATEGORIES},
    "elevations_deg": CONFIG["elevations_deg"],
    "shows": {
        "table1": "Table 1: mean absolute error by category, ours next to the published values.",
        "table2": "Table 2: mean absolute error by elevation, ours next to the published values.",
        "table3": "Table 3: pAUC by category, ours next to the published values.",
        "table4": "Table 4: pAUC by elevation, ours next to the published values.",
        "table5": "Table 5: mean absolute error by group of initial viewpoints.",
        "table6": "Table 6: estimates of single images, and their errors.",
        "table7": "Table 7: mean absolute error and pAUC by fold.",
        **{name: kind.caption for name, kind in FIGURES.items()},
        "claims": "The paper's claims: which hold, which do not, which are undecided, and why.",
        "report": "The page of the run: claims, tables, figures, settings, running time.",
        "runtime": "What the jobs of each rule cost.",
    },
}


def in_report(path, category, caption="result", **labels):
    """A file that Snakemake's report shows under a category, with labels to choose it by."""
    return report(
        path, caption=f"../report/{caption}.rst", category=category, labels=labels
    )

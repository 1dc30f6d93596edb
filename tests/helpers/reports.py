"""What a figure, a report and an explorer of the synthetic results are made of."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import synthetic
from nbv.experiment.explorer import ExplorerInputs
from nbv.experiment.paper.verdicts import evaluate_claims
from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.figures.inputs import FigureInputs
from nbv.experiment.report.runtime import load_jobs, runtime_table
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.table import write_table
from nbv.experiment.report.tables import TABLES, build_table, claims_table
from nbv.style import save_figure

POLICIES = dict(
    zip(synthetic.METHODS, ("none", "random", "opposite", "pose_ambiguity"), strict=True)
)


def figure_inputs(tree: Path, evaluations) -> FigureInputs:
    return FigureInputs(
        evaluations,
        depth=synthetic.depth_files(tree),
        objects=synthetic.object_files(tree),
        lookups=synthetic.lookup_files(tree),
    )


def explorer_inputs(tree: Path, **more) -> ExplorerInputs:
    return ExplorerInputs(
        name="synthetic",
        policies=POLICIES,
        evaluations=synthetic.evaluation_files(tree),
        lookups={(*k, "pose_ambiguity"): p for k, p in synthetic.lookup_files(tree).items()},
        min_separation_deg=15.0,
        n_views=5,
        **more,
    )


def report_files(root: Path, tree: Path, evaluations, drawn) -> dict[str, object]:
    """Write a report's parts below a folder; `drawn` makes the figure of a name."""
    tables = {name: root / f"{name}.html" for name in TABLES}
    for name, path in tables.items():
        files = {"html": path, "csv": path.with_suffix(".csv")}
        write_table(build_table(name, evaluations, ReportSettings(n_resamples=50)), files)
    figures = {name: root / f"drawn_{name}.svg" for name in FIGURES}
    for name, path in figures.items():
        figure: Figure = drawn(name)
        save_figure(figure, {"svg": path})
    claims = evaluate_claims(evaluations, np.random.default_rng(0), 100)
    write_table(claims_table(claims), {"csv": root / "verdicts.csv"})
    job = ("train", tree / "benchmark.tsv", root / "absent.log")
    write_table(runtime_table(load_jobs([job])), {"html": root / "cost.html"})
    return {
        "claims": root / "verdicts.csv",
        "configuration": tree / "configuration.yaml",
        "provenance": tree / "provenance.json",
        "splits": synthetic.split_files(tree),
        "tables": tables,
        "figures": figures,
        "table1": tables["table1"].with_suffix(".csv"),
        "runtime": root / "cost.html",
        "docs": "../../docs",
    }

"""Draw one of the paper's figures, or the animation of it."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.report.figures.build import build_figure
    from nbv.experiment.report.figures.inputs import FigureInputs
    from nbv.experiment.report.figures.steps import save_animation
    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.results import load_evaluations
    from nbv.style import save_figure

    given, params = snakemake.input, snakemake.params

    keys = {
        "evaluations": params.evaluations,
        "depth": params.units,
        "objects": params.units,
        "lookups": params.folds,
    }
    # A figure's rule declares what the figure needs, and nothing else.
    files = {
        name: dict(zip(keys[name], map(Path, of_kind), strict=True))
        for name, of_kind in given.items()
        if name in keys
    }
    evaluations = load_evaluations(files.pop("evaluations"))
    inputs = FigureInputs(evaluations, ReportSettings(**params.settings), **files)
    paths = {kind: Path(path) for kind, path in snakemake.output.items()}
    if "gif" in paths:
        save_animation(inputs, paths["gif"])
    else:
        save_figure(build_figure(snakemake.wildcards.figure, inputs), paths)

"""Draw one of the paper's figures."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_evaluations
    from nbv.reporting.paper.figures import FigureInputs, build_figure
    from nbv.reporting.settings import ReportSettings
    from nbv.reporting.style import save_figure

    given, params = snakemake.input, snakemake.params

    def files(name, keys):
        found = given.get(name)
        return dict(zip(keys, map(Path, found), strict=True)) if found else {}

    inputs = FigureInputs(
        evaluations=load_evaluations(files("evaluations", params.evaluations)),
        settings=ReportSettings(**params.settings),
        depth=files("depth", params.units),
        splits=files("splits", [category for category, _ in params.units]),
        lookups=files("lookups", params.folds),
    )
    figure = build_figure(snakemake.wildcards.figure, inputs)
    save_figure(figure, dict(snakemake.output.items()))

"""Draw one figure."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.results import load_evaluations
    from nbv.reporting.paper.figures import FigureInputs, build_figure, save_figure
    from nbv.reporting.settings import ReportSettings as ReadingSettings

    params, results = snakemake.params, Path(snakemake.output[0]).parents[1]
    evaluations = load_evaluations(results, params.units, params.n_folds, params.reading["methods"])
    inputs = FigureInputs(results, evaluations, ReadingSettings(**params.reading))
    figure = build_figure(snakemake.wildcards.figure, inputs)
    save_figure(figure, Path(snakemake.output[0]).with_suffix(""))

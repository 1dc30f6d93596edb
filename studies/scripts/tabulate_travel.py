"""Tabulate and draw error against travel."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from studies.curve_tables import travel_curves, travel_figure, travel_table

    from nbv.experiment.report.table import write_table
    from nbv.style import save_figure

    params, output = snakemake.params, snakemake.output
    curves = travel_curves(dict(zip(params.folds, snakemake.input.rows, strict=True)))
    write_table(travel_table(curves), {"csv": output.csv})
    figure = travel_figure(curves, tuple(params.methods))
    save_figure(figure, {kind: output[kind] for kind in ("png", "pdf", "svg")})

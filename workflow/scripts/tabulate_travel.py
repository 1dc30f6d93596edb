"""Tabulate and draw error against travel."""

from nbv.jobs import job

with job(snakemake):
    from nbv.experiments.travel import pooled_travel
    from nbv.files import read_csv
    from nbv.reporting.extensions.curves import travel_figure, travel_table
    from nbv.reporting.style import save_figure
    from nbv.reporting.table import write_table

    params, output = snakemake.params, snakemake.output
    folds: dict[str, dict] = {}
    for (category, _, fold), path in zip(params.folds, snakemake.input.rows, strict=True):
        folds.setdefault(category, {})[fold] = read_csv(path)
    curves = {category: pooled_travel(found) for category, found in folds.items()}
    write_table(travel_table(curves), {"csv": output.csv})
    figure = travel_figure(curves, tuple(params.methods))
    save_figure(figure, {kind: output[kind] for kind in ("png", "pdf")})

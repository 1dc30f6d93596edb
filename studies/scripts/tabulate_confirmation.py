"""Tabulate means and contrasts over all trainings, and draw the contrasts."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.confirmation import (
        belief_means,
        method_contrasts,
        method_means,
        training_contrasts,
    )
    from studies.confirmation_figures import (
        answers_figure,
        contrasts_figure,
    )

    from nbv.files import read_csv, write_csv
    from nbv.style import save_figure

    output = snakemake.output
    read = {
        name: pd.concat(
            [
                read_csv(path).assign(**place)
                for path, place in zip(snakemake.input[name], places, strict=True)
            ],
            ignore_index=True,
        )
        for name, places in snakemake.params.places.items()
    }
    objects = read["objects"]
    contrasts = method_contrasts(objects)
    tables = {
        "methods": method_means(objects),
        "contrasts": contrasts,
        "trainings": training_contrasts(objects),
        "beliefs": belief_means(read["beliefs"]),
        "densities": read["densities"],
    }
    for name, table in tables.items():
        write_csv(output[f"{name}_csv"], table)
    figures = {"answers": answers_figure(contrasts), "contrasts": contrasts_figure(contrasts)}
    for name, figure in figures.items():
        paths = {kind: output[f"{name}_{kind}"] for kind in ("png", "pdf", "svg")}
        save_figure(figure, paths)

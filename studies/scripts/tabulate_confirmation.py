"""Tabulate means and contrasts over all trainings."""

from nbv.experiment.jobs import job

with job(snakemake):
    import pandas as pd
    from studies.confirmation import (
        belief_means,
        method_contrasts,
        method_means,
        training_contrasts,
    )
    from studies.confirmation_tables import (
        answers_figure,
        beliefs_table,
        contrasts_figure,
        contrasts_table,
        densities_table,
        methods_table,
    )

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv, write_csv
    from nbv.robot.style import save_figure

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
    contrasts, of_trainings = method_contrasts(objects), training_contrasts(objects)
    tables = {
        "methods": methods_table(method_means(objects)),
        "contrasts": contrasts_table(contrasts, of_trainings),
        "beliefs": beliefs_table(belief_means(read["beliefs"])),
        "densities": densities_table(read["densities"]),
    }
    write_csv(output.trainings_csv, of_trainings)
    for name, table in tables.items():
        paths = {kind: output[f"{name}_{kind}"] for kind in ("csv", "md")}
        write_table(table, paths, snakemake.params.caution)
    figures = {"answers": answers_figure(contrasts), "contrasts": contrasts_figure(contrasts)}
    for name, figure in figures.items():
        paths = {kind: output[f"{name}_{kind}"] for kind in ("png", "pdf", "svg")}
        save_figure(figure, paths)

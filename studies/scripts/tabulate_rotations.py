"""Tabulate and draw up to four views in three dimensions, pooled over objects."""

from nbv.experiment.run.jobs import job

with job(snakemake):
    from pathlib import Path

    import numpy as np
    import pandas as pd
    from studies.curve_tables import rotation_figure
    from studies.rotation_tables import by_symmetry, orientation_table, reliability_table

    from nbv.experiment.report.table import write_table
    from nbv.files import read_csv, read_given_json
    from nbv.style import save_figure

    given, params, output = snakemake.input, snakemake.params, snakemake.output
    walks = [read_csv(path) for path in given.walks]
    if len(walks) > 1:
        walks = [each.assign(training=k) for k, each in enumerate(walks)]
    walks = pd.concat(walks, ignore_index=True)
    names = list(walks["object_id"].unique())
    groups = {name: [name] for name in names}
    if given.models_info:
        groups = by_symmetry(
            names, read_given_json(Path(given.models_info), "give BOP's models_info")
        )
    if len(names) > 1:
        groups["all categories" if "training" in walks else "all objects"] = names
    rng = np.random.default_rng(params.seed)
    table = orientation_table(walks, groups, params.n_resamples, rng)
    write_table(table, {kind: output[kind] for kind in ("csv", "md")})
    reliability = {kind: output[f"reliability_{kind}"] for kind in ("csv", "md")}
    write_table(reliability_table(walks, groups), reliability)
    save_figure(
        rotation_figure(table.cells), {kind: output[kind] for kind in ("png", "pdf", "svg")}
    )

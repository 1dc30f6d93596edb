"""Make the explorer, an interactive page."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.explorer import ExplorerInputs, build_explorer
    from nbv.files import write_text

    given, params = snakemake.input, snakemake.params
    keys = {
        "evaluations": params.evaluations,
        "lookups": params.lookups,
        "depth": params.units,
        "objects": params.units,
        "posteriors": params.folds,
    }
    # The rule declares what the run has: no depth images, or no distributions, in some.
    files = {
        name: dict(zip(keys[name], map(Path, paths), strict=True))
        for name, paths in given.items()
        if name in keys and paths
    }
    inputs = ExplorerInputs(
        name=params.name,
        policies=params.policies,
        min_separation_deg=params.more_views["min_separation_deg"],
        n_views=params.more_views["n_views"],
        caution=params.caution,
        **files,
    )
    write_text(snakemake.output[0], build_explorer(inputs))

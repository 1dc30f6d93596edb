"""Compare how well the densities of several runs know the azimuth."""

from nbv.experiment.jobs import job

with job(snakemake):
    from studies.densities import DensityRun, density_comparison

    from nbv.experiment.layout import files_by_run
    from nbv.experiment.report.settings import ReportSettings
    from nbv.experiment.report.table import write_table
    from nbv.experiment.results import load_evaluations

    given, params = snakemake.input, snakemake.params
    files = {
        name: files_by_run(params[name], given.get(name, []))
        for name in ("evaluations", "estimates", "lookups", "posteriors")
    }
    runs = {
        run: DensityRun(
            load_evaluations(evaluations),
            *(
                {fold[:3]: path for fold, path in files[name].get(run, {}).items()}
                for name in ("estimates", "lookups", "posteriors")
            ),
        )
        for run, evaluations in files["evaluations"].items()
    }
    table = density_comparison(runs, ReportSettings(**params.settings))
    write_table(table, dict(snakemake.output.items()), snakemake.params.caution)

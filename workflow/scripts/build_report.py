"""Show claims, tables, figures, settings and running time on one page."""

from pathlib import Path

from nbv.experiment.run.jobs import job

with job(snakemake):
    from nbv.experiment.report.page import build_report
    from nbv.files import write_text

    given, params = snakemake.input, snakemake.params
    page = build_report(
        claims=Path(given.claims),
        configuration=Path(given.configuration),
        provenance=Path(given.provenance),
        table1=Path(given.table1),
        runtime=Path(given.runtime),
        docs=params.docs,
        caution=params.caution,
        splits=dict(zip(params.categories, map(Path, given.splits), strict=True)),
        tables=dict(zip(params.tables, map(Path, given.tables), strict=True)),
        figures=dict(zip(params.figures, map(Path, given.figures), strict=True)),
    )
    write_text(snakemake.output[0], page)

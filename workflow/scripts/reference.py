"""Keep the results as the reference for their name."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.reference.store import collect_reference

    collect_reference(Path(snakemake.input.report).parent, Path(snakemake.params.reference))

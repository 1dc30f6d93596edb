"""Keep the results as the reference for their name."""

from pathlib import Path

from nbv.experiment.run.jobs import job, need_intact

with job(snakemake):
    from nbv.experiment.run.reference import collect_reference

    need_intact(snakemake.params.run)
    collect_reference(Path(snakemake.params.run), Path(snakemake.params.reference))

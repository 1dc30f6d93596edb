"""Gather claims, tables, figures, settings and runtime on one page."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.evaluation.report import build_report
    from nbv.files import write_text

    write_text(snakemake.output[0], build_report(Path(snakemake.output[0]).parent))

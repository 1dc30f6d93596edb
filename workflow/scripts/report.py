"""Gather claims, tables, figures, settings and runtime on one page."""

from pathlib import Path

from nbv.jobs import job

with job(snakemake):
    from nbv.files import write_text
    from nbv.reporting.report import build_report

    write_text(snakemake.output[0], build_report(Path(snakemake.output[0]).parent))
